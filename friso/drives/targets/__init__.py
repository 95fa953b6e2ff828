"""Targets of `friso export`, one file each; the registry finds them by the names of their modules."""
