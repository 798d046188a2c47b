"""The messages of these protocols: those of `syncabb.py` are in `messages/syncabb.py`."""
