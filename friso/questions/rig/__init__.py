"""What `friso rig` shows: words, figures, document and page."""
