"""The pictures of the README and the start page: ``python docs/picture.py``.

    pip install . matplotlib spm1d

Sixty steps of one person at three speeds, which the wheel of spm1d holds (Pataky et al., 2008):
the vertical ground force from heel strike to toe-off, before and after the alignment. Ticks below
the curves are where each step has its first peak, its valley and its second peak.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from sklearn_motionsync import DenseSynchronizer

SUBJECT = 6
PANELS = {"recorded": "Time-normalised", "aligned": "Aligned by DenseSynchronizer()"}


def moments(curve):
    """Frames of the first peak, the valley and the second peak."""
    first, second = 5 + np.argmax(curve[5:45]), 55 + np.argmax(curve[55:96])
    return [first, first + np.argmin(curve[first : second + 1]), second]


def main():
    """Draw them."""
    import spm1d

    folder = Path(spm1d.__file__).parent / "data" / "datafiles"
    forces = np.load(folder / f"ex_grf_subj{SUBJECT:03}.npy")
    X = forces[..., np.newaxis]
    match = DenseSynchronizer(n_frames=101).fit(X).match(X)
    percent = np.arange(101)
    found = np.array([moments(curve) for curve in forces], dtype=float)
    moved = [np.interp(at, times, percent) for at, times in zip(found, match.times, strict=True)]
    curves = {"recorded": forces, "aligned": match.warp(X)[..., 0]}
    for (name, title), places in zip(PANELS.items(), (found, np.array(moved)), strict=True):
        figure, axis = plt.subplots(figsize=(4.2, 3.1), layout="constrained")
        axis.plot(percent, curves[name].T, color="tab:blue", alpha=0.3, linewidth=0.8)
        axis.plot(percent, curves[name].mean(axis=0), color="black", linewidth=2)
        for k, color in enumerate(("tab:red", "tab:green", "tab:purple")):
            axis.vlines(places[:, k], -0.16, -0.04, color=color, alpha=0.5, linewidth=0.8)
        axis.set(title=title, xlabel="stance (%)", ylabel="vertical force (body weights)")
        axis.set_xlim(0, 100)
        figure.savefig(Path(__file__).parent / "_static" / f"steps_{name}.png", dpi=150)


if __name__ == "__main__":
    main()
