"""Fit friction laws to logs, and decide by prediction of left-out parts which laws the record supports."""
