"""What `friso simulate` shows: the document, and the files of a time response."""
