"""The messages that these protocols send. Those of `mgm.py` are in `messages/mgm.py`."""
