"""The thesis behind friso, recomputed and judged, and its design guideline: a package that plugs into friso."""
