"""Distributed Constraint Reasoning Protocols unit: one file a protocol, each naming its paper.

`protocol.py` declares the interface. Protocols are grouped in families, one folder each; `shared` contains parts that
several families use. A protocol's file contains its messages and settings as well, except where mypyc compiles the
protocol: then its messages are in `X_messages.py`.

Everything here is pure: no clock, no chance, no process, no input or output (import-linter sees to it).
"""
