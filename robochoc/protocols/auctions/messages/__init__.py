"""The messages that these protocols send. Those of `ssi.py` are in `messages/ssi.py`."""
