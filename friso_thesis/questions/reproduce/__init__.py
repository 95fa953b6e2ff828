"""What `friso reproduce` shows: words, figures, document and page."""
