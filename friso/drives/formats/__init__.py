"""Kinds of parameter files, each in a file that declares `FORMAT` (`friso.drives.format`)."""
