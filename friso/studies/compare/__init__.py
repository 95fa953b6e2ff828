"""Compare a joint and settings of the controller on the same random machines."""
