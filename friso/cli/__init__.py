"""The command line of friso."""

from friso.cli.app import main

__all__ = ["main"]
