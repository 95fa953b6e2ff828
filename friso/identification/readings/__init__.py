"""Read passes at constant velocity, slips, and the force on the bearing from logs, for several kinds of experiment."""
