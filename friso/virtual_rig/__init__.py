"""Run stages with their real drive, for the experiments of a virtual test rig."""
