"""What `friso compare` shows: words, figures, document and page."""
