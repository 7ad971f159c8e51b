"""While a movement runs: its phase, and a body that is partly hidden."""
