"""The messages that these protocols send. Those of `dpop.py` are in `messages/dpop.py`."""
