"""`Terminated`, raised on SIGTERM. A separate module: the command line needs it before it may import anything slow."""

from __future__ import annotations


class Terminated(SystemExit):
    """Raised on SIGTERM. Unlike other `SystemExit`s, it is never raised by the code of a package."""
