"""The thesis's own experiments of the rig, one module each, named in pyproject.toml."""
