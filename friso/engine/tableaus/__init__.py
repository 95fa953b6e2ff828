"""Linearly implicit methods, one file each, as coefficients."""
