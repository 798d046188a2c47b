"""The option `--order`: the name of a priority order, or a file that lists the robots."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from robochoc.cli.options.value_types import NameOrFile

if TYPE_CHECKING:
    from robochoc.model.orders import Order
    from robochoc.model.problem import Team

GIVEN = "given"
NAMES = (GIVEN, "lexicographic", "max-degree", "min-width", "dom-deg", "dfs", "random")
ORDER_NAME = NameOrFile("order", NAMES, {"dom/deg": "dom-deg"})


def order_for(team: Team, order: str | Path | None, names: Mapping[str, str] = {}) -> Order | tuple[str, ...] | None:
    """Return the order for `team`, or None if none was given.

    Args:
        team: The team.
        order: The name of the order, or the path of a file.
        names: The original names of the robots, which may be used in a file.

    Raises:
        InvalidInputError: if a file does not list exactly the team's robots.
    """
    if isinstance(order, Path):
        from robochoc.formats.order_file import read_order

        return read_order(order, team, names)
    from robochoc.model.orders import Order

    return None if order is None else Order(order)
