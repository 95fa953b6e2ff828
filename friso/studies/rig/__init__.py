"""The thesis's experiments on the virtual test rig (Sec. 4): what is run, and what is read off the logs."""
