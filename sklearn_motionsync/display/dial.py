"""PhaseDial: the phase of a running performance as a ring, with what comes next."""

import numpy as np

from .drawing import COLORS

__all__ = ["PhaseDial"]

# Inner and outer radius of the ring and of the arc around it; the radius of the numbers, and the
# inner radius of the hand.
_RING, _ARC, _NUMBERS, _HAND = (0.78, 1.0), (1.05, 1.13), 1.28, 0.62
# The opacity of the ring at confidence 0.
_MIN_OPACITY = 0.12


class PhaseDial:
    """A ring from 0 % at the top clockwise to 100 %.

    Parameters
    ----------
    axis : Axes

    Attributes
    ----------
    passed : Wedge
        From 0 to the phase; the opacity shows the confidence.
    ahead : Wedge
        From the phase to the phase ahead.
    hand : Line2D
        The line width shows the confidence.
    share, state : Text
        The phase in per cent; rate and confidence.
    """

    def __init__(self, axis):
        from matplotlib.patches import Wedge

        axis.set_aspect("equal")
        axis.set_xlim(-1.5, 1.5)
        axis.set_ylim(-1.75, 1.45)
        axis.axis("off")

        def ring(color, radii, zorder, end=90):
            wedge = Wedge(
                (0, 0),
                radii[1],
                end,
                90,
                width=radii[1] - radii[0],
                facecolor=color,
                linewidth=0,
                zorder=zorder,
            )
            return axis.add_patch(wedge)

        ring(COLORS["shadow"], _RING, 1, end=-270)
        self.passed = ring(COLORS["performance"], _RING, 2)
        self.ahead = ring(COLORS["mean"], _ARC, 3)
        (self.hand,) = axis.plot([], [], color=COLORS["pattern"], solid_capstyle="round", zorder=4)
        for quarter, text in enumerate(("0 %", "25", "50", "75")):
            x, y = _on_circle(quarter / 4, _NUMBERS + 0.02 * (quarter % 2))
            axis.text(
                x, y, text, ha="center", va="center", color="0.35", fontsize="x-small", zorder=1
            )
        self.share = axis.text(0, 0, "", ha="center", va="center", fontsize="large")
        self.state = axis.text(0, -1.62, "", ha="center", va="center", fontsize="small")

    def show(self, share, ahead, rate, confidence, cycle=None):
        """Move the hand to a share of the action, or of the cycle of this number."""
        # Rounding may take a sum of probabilities above 1.
        confidence = min(confidence, 1)
        self.passed.set_theta1(90 - 360 * share)
        self.passed.set_alpha(_MIN_OPACITY + (1 - _MIN_OPACITY) * confidence)
        self.ahead.set_theta1(90 - 360 * ahead)
        self.ahead.set_theta2(90 - 360 * share)
        # A wedge of no length would be drawn as a whole ring.
        self.ahead.set_visible(ahead > share)
        self.hand.set_data(*np.transpose([_on_circle(share, _HAND), _on_circle(share, _RING[1])]))
        self.hand.set_linewidth(1 + 4 * confidence)
        self.share.set_text(f"{100 * share:.0f} %")
        number = "" if cycle is None else f"cycle {cycle:.0f}, "
        self.state.set_text(f"{number}rate {rate:.1f}, confidence {confidence:.2f}")


def _on_circle(share, radius):
    """The point at a share of a circle, clockwise from the top."""
    angle = 2 * np.pi * share
    return radius * np.sin(angle), radius * np.cos(angle)
