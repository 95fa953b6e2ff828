"""What a person sees of it: words, figures, documents and pages by command, templates beside them."""
