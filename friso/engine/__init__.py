"""Turn equations into numbers: compiled code, cached on disk, that runs several stages at once."""
