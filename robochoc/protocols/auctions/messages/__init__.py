"""What these protocols send: the messages of `ssi.py` are in `messages/ssi.py`."""
