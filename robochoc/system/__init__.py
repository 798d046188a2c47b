"""Wrappers of Python and the operating system: files, plug-ins, text for terminals."""
