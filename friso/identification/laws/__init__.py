"""Friction laws fitted to the same logs, and which of them the record supports: by prediction of what was left out."""
