"""The thesis's own experiments of the rig, a module each, which pyproject.toml names to friso in entry points."""
