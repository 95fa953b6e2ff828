"""Experiments of the rig, one file each: each declares how it is run, `run_experiment`."""
