"""What `friso check` shows: words, figures, document and page."""
