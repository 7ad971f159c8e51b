"""The body: skeletons, the landmarks of the paper's fifteen joints, postures by Eq. 1."""
