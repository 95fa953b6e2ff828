"""The command line."""

from friso.cli.app import app, main

__all__ = ["app", "main"]
