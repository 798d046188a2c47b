"""The output of commands: tables for people, and JSON for programs.

The report of a command is in a separate module if it imports much, so that the command's help stays fast.
"""
