"""What SIGTERM raises."""


class Terminated(SystemExit):
    """The program was told to end. Unlike another `SystemExit`, it is never that of a package's own code."""
