"""What `friso bode` shows: words, figures, document and page."""
