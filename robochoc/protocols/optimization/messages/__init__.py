"""The messages that these protocols send. Those of `adopt.py` are in `messages/adopt.py`."""
