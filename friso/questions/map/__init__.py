"""What `friso map` shows: words, figures, document and page."""
