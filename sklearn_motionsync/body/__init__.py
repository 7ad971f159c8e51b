"""The body: skeletons, the landmarks of the paper's fifteen joints, poses by Eq. 1."""
