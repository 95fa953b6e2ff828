"""Functions of this package, one module each, which answer like friso's own."""
