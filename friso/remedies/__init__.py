"""Remedies for a stage that hunts: settings and isolators optimised one remedy at a time, verified by cycles."""
