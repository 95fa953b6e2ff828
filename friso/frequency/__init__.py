"""Analyse stages as linear systems: limit cases and the family behind them, margins, highest bandwidth."""
