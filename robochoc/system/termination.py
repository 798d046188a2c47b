"""`Terminated`, raised on SIGTERM. It has its own module because the command line needs it before slow imports."""

from __future__ import annotations


class Terminated(SystemExit):
    """Raised on SIGTERM. Unlike other `SystemExit` exceptions, it is never raised by the code of a package."""
