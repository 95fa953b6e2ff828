"""Commands of this package, one module each, declared as entry points in pyproject.toml."""
