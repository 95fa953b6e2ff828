"""Isolator or firmware: the same drawn machines settled by a joint, and by settings of the controller."""
