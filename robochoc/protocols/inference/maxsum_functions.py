"""The functions that one robot holds, with what has been told to them (the Max-Sum family)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from robochoc.model.message import Value
from robochoc.protocols.inference.maxsum_factor import Factor, Row

if TYPE_CHECKING:
    from robochoc.solver.cost_table import CostTable


class Functions:
    """The functions of a robot: `q` are the last Q to them, for each robot above a row for each function with it.

    All are 0 at first.
    """

    def __init__(self, tables: Iterable[CostTable], domains: Mapping[str, Sequence[Value]]) -> None:
        self.factors = Factor.joined(tables)
        self.q: dict[str, list[Row]] = {
            name: [[0.0] * len(values) for factor in self.factors if name in factor.agents]
            for name, values in domains.items()
        }
        self._sizes = {name: len(values) for name, values in domains.items()}

    def hear(self, name: str, rows: list[Row]) -> None:
        """Keep Q of a robot above. Raises `ValueError` for rows that do not fit."""
        self.q[name] = checked(rows, len(self.q[name]), self._sizes[name])

    def answers(self, own: Sequence[Row]) -> tuple[list[Row], dict[str, list[Row]]]:
        """Return R to the own variable, and to each robot above; `own` are Q of the own variable."""
        told = {name: iter(rows) for name, rows in self.q.items()}
        mine: list[Row] = []
        theirs: dict[str, list[Row]] = {name: [] for name in self.q}
        for factor, row in zip(self.factors, own, strict=True):
            answers = factor.r([*[next(told[name]) for name in factor.agents], row])
            mine.append(answers.pop())
            for name, answer in zip(factor.agents, answers, strict=True):
                theirs[name].append(answer)
        return mine, theirs


def checked(rows: list[Row], many: int, size: int) -> list[Row]:
    """Return `rows`; `ValueError` if they are not so many, or not all of `size` entries."""
    if len(rows) != many or any(len(row) != size for row in rows):
        raise ValueError(f"the message has not {many:,} rows of {size:,} entries")
    return rows
