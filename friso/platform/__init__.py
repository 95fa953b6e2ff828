"""Handle files, signals, processes and installed packages alike on all operating systems."""
