"""Remedies for a stage that hunts, in words, tables and figures."""
