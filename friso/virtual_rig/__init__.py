"""The drive as built, and the experiments of a virtual test rig on it."""
