"""Base classes for several families: the pseudo-tree (`dfs.py`) and synchronous cycles (`cycles.py`)."""
