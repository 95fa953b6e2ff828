"""Turn parameter files of drives into stages, and stages into such parameters."""
