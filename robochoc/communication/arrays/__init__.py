"""The array runtime: synchronous protocols in numpy, which computes each cycle for all robots of a team at once.

A robot is a row in arrays, and sends no messages. The values, costs and counts equal those of the same run in the
simulator (tests/unit/communication/arrays).
"""
