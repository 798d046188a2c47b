"""`--order`: a priority order by name, or a file that lists the robots."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import PathLike

if TYPE_CHECKING:
    from robochoc.model.orders import Order
    from robochoc.model.problem import Team

GIVEN = "given"
NAMES = (GIVEN, "lexicographic", "max-degree", "min-width", "dom-deg", "dfs", "random")


class OrderName(click.Path):
    """A name in `NAMES`, or else the path of a file that is there."""

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> str | Path:
        """The name, or the path. Fails, as wrong usage, where it is neither."""
        word = os.fsdecode(value)
        if word == "dom/deg":  # as it is written elsewhere
            return "dom-deg"
        if word in NAMES:
            return word
        if not word or not os.path.lexists(word):
            import difflib

            near = difflib.get_close_matches(word, NAMES, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"orders: {', '.join(NAMES)}"
            self.fail(f"'{word}' is no order and no file; {hint}", param, ctx)
        return Path(word)


def order_for(team: Team, order: str | Path) -> Order | tuple[str, ...] | None:
    """The order for `team`; None: the files' own. Raises `InvalidInputError` where a file does not list its robots."""
    from robochoc.formats.order import read_order
    from robochoc.model.orders import Order

    if isinstance(order, Path):
        return read_order(order, team)
    return None if order == GIVEN else Order(order)
