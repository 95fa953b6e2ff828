"""What several kinds of experiment read off a log: passes at constant velocity, slips, the force on the bearing."""
