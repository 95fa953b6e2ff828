"""Declare the physics once, as symbols, and find which parts of it a stage needs."""
