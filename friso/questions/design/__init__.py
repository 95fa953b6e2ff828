"""What `friso design` shows: words, figures, document and page."""
