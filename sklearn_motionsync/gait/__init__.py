"""Walking and running: events of the feet, and spatio-temporal parameters.

`gait_events` finds strikes and foot-offs in the positions of the feet, and `gait_parameters` makes
of them the times, lengths and speeds that gait labs report.
"""

from .events import gait_events
from .parameters import gait_parameters

__all__ = [
    "gait_events",
    "gait_parameters",
]
