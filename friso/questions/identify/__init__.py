"""What `friso identify` shows: words, figures, document and page."""
