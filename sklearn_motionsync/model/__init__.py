"""What an action looks like, how people vary in it, and what is not the action (section 4).

`ActionModel` holds the mean and the variance of aligned trials, `ActionDetector` tells whether a
trial is the action at all, and `find_departures` lists where, when and in which limb a trial
departs from it.
"""

from .action_model import ActionModel
from .departures import find_departures
from .detector import ActionDetector

__all__ = [
    "ActionDetector",
    "ActionModel",
    "find_departures",
]
