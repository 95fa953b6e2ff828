"""Compare a joint with settings of the controller on the same random machines."""
