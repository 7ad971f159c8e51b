"""A report about a set of aligned trials: one HTML file that needs no network."""
