"""What these protocols send: the messages of `dpop.py` are in `messages/dpop.py`."""
