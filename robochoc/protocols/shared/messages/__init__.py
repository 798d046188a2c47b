"""What is sent: the messages of `dfs.py` are in `messages/dfs.py`."""
