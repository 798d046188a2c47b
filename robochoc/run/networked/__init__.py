"""Runs on several machines: implements `robochoc master`, `robot` and `directory`, and their functions in Python.

`master_run.py` is the master's side of a run, `join.py` a robot's side, `directory_query.py` a query to the Directory
Facilitator. The network itself is in `communication/network/`.
"""
