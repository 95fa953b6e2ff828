"""Analyse stages as linear systems: limit cases, states between them, and margins."""
