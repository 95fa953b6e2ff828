"""How outcomes of the rig's experiments are shown, one file each: each declares its `VIEW`."""
