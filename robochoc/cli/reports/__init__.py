"""The output of commands: tables for people, JSON for programs.

The report of a command is a module of its own if it imports much, so that the command's help does not.
"""
