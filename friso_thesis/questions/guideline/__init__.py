"""What `friso guideline` shows: words, figures, document and page."""
