"""What these protocols send: the messages of `mgm.py` are in `messages/mgm.py`."""
