"""Output-error fitting: the whole model, friction included, simulated against the log."""
