"""The command line."""

from friso.cli.app import main

__all__ = ["main"]
