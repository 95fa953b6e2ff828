"""What `friso flexure` shows: words, figures, document and page."""
