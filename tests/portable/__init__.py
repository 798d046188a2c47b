"""What works on every system: CI runs these tests on macOS and Windows, with an installed wheel, without conftest.py.

They use nothing but robochoc's public names, so that they also show whether a wheel is complete.
"""
