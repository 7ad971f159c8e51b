"""A report about a set of aligned trials, and a player of them: HTML files that need no network."""

from .player import write_player
from .report import write_report

__all__ = [
    "write_player",
    "write_report",
]
