"""The functions of this package, a module each, which answer like friso's own."""
