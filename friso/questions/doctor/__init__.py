"""What `friso doctor` shows."""
