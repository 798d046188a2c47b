"""What protocols of several families are built on: the pseudo-tree (`dfs.py`), and synchronous cycles (`cycles.py`)."""
