"""Distributed Constraint Reasoning Protocols unit: one file a protocol, each beside its paper.

What a protocol is stands here. Protocols stand in families: `satisfaction`, `optimization`, `inference` and
`local_search`; what several families are built on is in `shared`. Messages and settings of a family have folders of
their own: those of `satisfaction/abt.py` are in `satisfaction/messages/abt.py`.

Everything here is pure: no clock, no chance, no process, no input or output (import-linter sees to it).
"""
