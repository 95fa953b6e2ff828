"""Turn equations into numbers: compiled code, cached on disk, for several runs at once."""
