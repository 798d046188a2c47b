"""Settings of `cycles.py`."""
