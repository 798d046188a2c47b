"""The runtime of arrays: synchronous protocols, cycle by cycle, for all robots of a team at once, in numpy.

A robot is a row in arrays, and sends no messages. Values, costs and counts equal those of the same run in the simulator
(tests/unit/communication/arrays).
"""
