"""Turn equations into numbers: generated kernels, cached on disk, run in lanes and threads."""
