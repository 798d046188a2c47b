"""Wrappers of Python and the operating system: files, signals, installed packages, printable text."""
