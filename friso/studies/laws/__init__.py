"""Convert friction laws, and judge a stage under each law that fits its measurements."""
