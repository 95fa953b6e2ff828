"""The commands of this package, a module each, which pyproject.toml names to friso in entry points."""
