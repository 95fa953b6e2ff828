"""Commands of this package, one module each, which pyproject.toml declares as entry points of friso."""
