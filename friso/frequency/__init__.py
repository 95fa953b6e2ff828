"""Stages as linear systems: limit cases and the family behind them, margins, how fast a controller may be."""
