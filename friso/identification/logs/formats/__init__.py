"""Formats of logs, one file each: how one is recognised and read; each declares itself as `FORMAT`."""
