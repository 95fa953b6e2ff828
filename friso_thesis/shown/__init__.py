"""Show results to people: words, figures, documents and pages, with their templates."""
