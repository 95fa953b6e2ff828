"""Show the outcomes of the rig's experiments; each module declares the `VIEW` of one."""
