"""Reading logs: sniff, table of channels, roles, checks, log."""
