"""What these protocols send: the messages of `adopt.py` are in `messages/adopt.py`."""
