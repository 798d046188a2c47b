"""Distributed Constraint Reasoning Protocols unit: one file a protocol, each beside its paper.

Everything here is pure: no clock, no chance, no process, no input or output (import-linter sees to it).
"""
