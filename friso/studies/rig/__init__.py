"""Run the thesis's experiments on the virtual test rig (Sec. 4), and evaluate the logs."""
