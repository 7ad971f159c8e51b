"""Long recordings cut into performances: cycles, and where an action happens."""
