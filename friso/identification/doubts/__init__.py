"""Effects that a log may hold and the model leaves out: one file each, see `friso/identification/doubt.py`."""
