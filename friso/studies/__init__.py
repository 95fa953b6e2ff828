"""Run and judge many stages at once: sweeps, stores, draws, comparisons."""
