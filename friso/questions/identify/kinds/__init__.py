"""Show results of experiments; each module declares the `VIEW` of the kind that it is named after."""
