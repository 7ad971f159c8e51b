"""From long takes to performances: cycles, and where an action happens."""
