"""The thesis's own experiments of the rig, one module each, which pyproject.toml names in entry points."""
