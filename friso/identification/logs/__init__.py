"""Read logs: recognise the format, read channels, assign roles, check signals, and assemble the log."""
