"""Show results to people: words, figures, documents and pages by command, with their templates."""
