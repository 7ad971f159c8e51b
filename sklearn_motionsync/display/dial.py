"""A dial: how much of an action is over, how sure that is, and how much will be over soon."""

import numpy as np

from .drawing import COLORS

__all__ = ["Dial"]

# Inner and outer radius of the ring, and of the arc around it; how far out the letters are, and
# where the hand begins.
_RING, _ARC, _LETTERS, _HAND = (0.78, 1.0), (1.05, 1.13), 1.28, 0.62
# How strongly what nobody is sure of is still seen.
_FAINTEST = 0.12


class Dial:
    """A ring from 0 % at the top, clockwise to 100 %, in axes of its own.

    Parameters
    ----------
    axis : Axes

    Attributes
    ----------
    passed : Wedge
        What is over; the paler, the less sure.
    ahead : Wedge
        Where it will be soon.
    hand : Line2D
        The thicker, the surer.
    share, says : Text
        How much is over; rate and confidence.
    """

    def __init__(self, axis):
        from matplotlib.patches import Wedge

        self._axis = axis
        axis.set_aspect("equal")
        axis.set_xlim(-1.5, 1.5)
        axis.set_ylim(-1.75, 1.45)
        axis.axis("off")

        def ring(color, radii, zorder, end=90):
            style = {"width": radii[1] - radii[0], "facecolor": color, "linewidth": 0}
            return axis.add_patch(Wedge((0, 0), radii[1], end, 90, zorder=zorder, **style))

        ring(COLORS["shadow"], _RING, 1, end=-270)
        self.passed = ring(COLORS["performance"], _RING, 2)
        self.ahead = ring(COLORS["mean"], _ARC, 3)
        style = {"color": COLORS["pattern"], "solid_capstyle": "round", "zorder": 4}
        (self.hand,) = axis.plot([], [], **style)
        style = {"ha": "center", "va": "center", "color": "0.35", "fontsize": "x-small"}
        for quarter, text in enumerate(("0 %", "25", "50", "75")):
            x, y = _at(quarter / 4, _LETTERS + 0.02 * (quarter % 2))
            axis.text(x, y, text, **style)
        self.share = axis.text(0, 0, "", ha="center", va="center", fontsize="large")
        self.says = axis.text(0, -1.62, "", ha="center", va="center", fontsize="small")

    def show(self, share, soon, rate, confidence):
        """Put the hand at a share of the action; the artists that have changed."""
        self.passed.set_theta1(90 - 360 * share)
        self.passed.set_alpha(_FAINTEST + (1 - _FAINTEST) * confidence)
        self.ahead.set_theta1(90 - 360 * soon)
        self.ahead.set_theta2(90 - 360 * share)
        # An arc of no length would be a whole ring's outline.
        self.ahead.set_visible(soon > share)
        self.hand.set_data(*np.transpose([_at(share, _HAND), _at(share, _RING[1])]))
        self.hand.set_linewidth(1 + 4 * confidence)
        self.share.set_text(f"{100 * share:.0f} %")
        self.says.set_text(f"rate {rate:.1f}, confidence {confidence:.2f}")
        return [self.passed, self.ahead, self.hand, self.share, self.says]


def _at(share, radius):
    """Where a share of the action is on a circle."""
    angle = 2 * np.pi * share
    return radius * np.sin(angle), radius * np.cos(angle)
