"""Frequency responses from measured records, and what they show: mass lines, modes, friction."""
