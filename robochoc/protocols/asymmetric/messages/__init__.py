"""What these protocols send: the messages of `syncabb.py` are in `messages/syncabb.py`."""
