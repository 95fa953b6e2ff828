"""Kinds of experiment, one file and one class each, declared as `KIND`: how logs are analysed, and results shown."""
