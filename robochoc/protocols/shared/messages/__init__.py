"""The messages of `dfs.py`, in a module of their own: mypyc compiles `dfs.py`, and cannot compile msgspec's classes."""
