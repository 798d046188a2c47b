"""pyDCOP's own command line, `pydcop`, on a Python that is newer than pyDCOP: `pydcop_once.py WORDS...`.

Runs in the peer's own Python, which has pyDCOP 0.1.2a1, numpy before 2 and no robochoc. Nothing of pyDCOP is changed:
before it is imported, what it needs of older Pythons, numpy and PuLP gets its old names back.
"""

from __future__ import annotations

import collections
import collections.abc
import sys
from typing import Any

import numpy as np


def main() -> None:
    """Put the old names back, and let pyDCOP read the command line."""
    for name in ("Callable", "Hashable", "Iterable", "Mapping", "Sequence"):
        setattr(collections, name, getattr(collections.abc, name))
    old: Any = np
    old.asscalar = lambda array: array.item()
    import pulp  # type: ignore[import-not-found]  # noqa: PLC0415 - after what it may need

    sys.modules.setdefault("pulp.solvers", pulp)
    from pydcop import dcop_cli  # type: ignore[import-not-found]  # noqa: PLC0415 - it needs what is above

    dcop_cli.main()


if __name__ == "__main__":
    main()
