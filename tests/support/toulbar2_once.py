"""Solves files with toulbar2's own reader: `python toulbar2_once.py FILE ...`.

It prints a line for each file: its optimum, or `null`. Each file has a process of its own, because toulbar2 keeps the
sign of a maximised problem for the next one, and ends the process if it cannot read a file.
"""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Read and solve each file."""
    from pytoulbar2 import CFN  # noqa: PLC0415 - an extra

    for path in sys.argv[1:]:
        if pid := os.fork():
            os.waitpid(pid, 0)
            continue
        problem = CFN()
        try:
            problem.Read(path)
            found = problem.Solve()
        except problem.Contradiction:
            found = None
        os.write(1, b"null\n" if found is None else f"{found[1]:.9f}\n".encode())
        os._exit(0)


if __name__ == "__main__":
    main()
