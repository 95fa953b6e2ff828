"""What `friso boundary` shows: words, figures, document and page."""
