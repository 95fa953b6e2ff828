"""Kinds of experiment of the thesis, as `friso identify` takes them (Sec. 4.1 to 4.3)."""
