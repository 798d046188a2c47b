"""What these protocols send: the messages of `abt.py` are in `messages/abt.py`."""
