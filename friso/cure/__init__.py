"""The cure of a stage that hunts: settings and isolators optimised one way at a time, verified by cycles."""
