"""pyDCOP's command `pydcop` on a Python that is newer than pyDCOP: `pydcop_once.py WORDS...`.

This runs in a Python that has pyDCOP 0.1.2, numpy before 2 and no robochoc. Nothing of pyDCOP is changed: before it is
imported, the names of older versions of Python, numpy and PuLP that it needs are defined.
"""

from __future__ import annotations

import collections
import collections.abc
import sys
from typing import Any

import numpy as np


def main() -> None:
    """Define the old names, and let pyDCOP read the command line."""
    for name in ("Callable", "Hashable", "Iterable", "Mapping", "Sequence"):
        setattr(collections, name, getattr(collections.abc, name))
    old: Any = np
    if int(np.__version__.split(".", maxsplit=1)[0]) > 1:
        sys.exit("pyDCOP requires numpy before version 2")
    old.asscalar = lambda array: array.item()
    import pulp  # type: ignore[import-not-found]  # noqa: PLC0415 - after the names that it may need

    sys.modules.setdefault("pulp.solvers", pulp)
    from pydcop import dcop_cli  # type: ignore[import-not-found]  # noqa: PLC0415 - it needs the names above

    dcop_cli.main()


if __name__ == "__main__":
    main()
