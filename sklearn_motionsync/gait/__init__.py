"""Walking and running: events of the feet, and spatio-temporal parameters."""
