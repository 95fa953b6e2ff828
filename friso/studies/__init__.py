"""Studies: many stages at once."""
