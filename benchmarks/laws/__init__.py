"""Test random stages under each friction law against SciPy and brute force."""
