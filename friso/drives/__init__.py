"""Turn parameter files of drives and motion controllers into stages, and stages into such parameters."""
