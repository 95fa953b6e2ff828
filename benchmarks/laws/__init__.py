"""Test random stages under each friction law: cycles, multipliers and edges against SciPy and brute force."""
