"""Long recordings cut into trials: cycles, and where an action happens."""
