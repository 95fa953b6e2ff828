"""Hunting by its return map: from the distance at which a stage lands to that at which it lands next."""
