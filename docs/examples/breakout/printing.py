"""Printing to a reader that may stop reading, such as `head`."""

from __future__ import annotations

import os
import sys


def show(text: object) -> None:
    """Print `text`. If the reader of the output has ended, end this program without a traceback (status 1)."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python fails again when it ends
        sys.exit(1)
