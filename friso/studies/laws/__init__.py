"""Convert friction laws into each other, and judge a stage under each law that fits the measurements."""
