"""What `friso convert` shows."""
