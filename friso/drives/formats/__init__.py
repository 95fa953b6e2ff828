"""The kinds of parameter files, one file each, which declares `FORMAT` (`friso.drives.format`)."""
