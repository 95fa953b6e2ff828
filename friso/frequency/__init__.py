"""Analyse stages as linear systems: limit cases and states between them, margins, highest bandwidth."""
