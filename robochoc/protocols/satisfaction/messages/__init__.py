"""The messages that these protocols send. Those of `abt.py` are in `messages/abt.py`."""
