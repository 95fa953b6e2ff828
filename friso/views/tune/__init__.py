"""The cure of a stage, in words, tables and figures."""
