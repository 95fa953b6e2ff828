"""Files, signals, processes and installed packages, whatever the operating system."""
