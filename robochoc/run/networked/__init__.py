"""Runs on several machines from their ends: what `robochoc master`, `robot` and `directory` do, and the API with them.

`lead.py` is the master's side of a whole run, `join.py` a robot's, `consult.py` a question to the Directory
Facilitator. The network itself is `communication/network/`.
"""
