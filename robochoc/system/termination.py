"""The exception raised on SIGTERM."""


class Terminated(SystemExit):
    """A signal ends the program. Unlike other `SystemExit`s, it never comes from a package's code."""
