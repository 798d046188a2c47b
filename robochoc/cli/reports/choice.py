"""The choice of a protocol and an order, for people: `robochoc solve --explain`, and a note where a run takes long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from robochoc.cli.reports.progress import print_above
from robochoc.formats import on_one_line
from robochoc.run.choice import ORDERS_TEXT, Choice, faster_order
from robochoc.run.choice_rules import RULES, Rule

if TYPE_CHECKING:
    from robochoc.communication.run_result import Progress
    from robochoc.model.problem import Team
    from robochoc.run.options import Options

LONG_S = 5.0
"""Seconds of a search after which it is said that another order is usually faster."""


def choice_lines(choice: Choice) -> Iterator[str]:
    """Yield what is known of the team, and why other protocols were not chosen; nothing where one was asked for."""
    if choice.facts:
        yield f"  the team: {'; '.join(choice.facts)}"
    for name, why in choice.rejected:
        yield on_one_line(f"  not {name}: {why}")


def rules_text() -> str:
    """Return how a protocol and an order are chosen."""
    head = "auto: no protocol of its own. It takes the first of these that suits the team and accepts all options"
    rules = [line for rule in RULES for line in _rule_lines(rule)]
    return "\n".join([head, *rules, *ORDERS_TEXT, "next: robochoc solve --explain says it of a team"])


def _rule_lines(rule: Rule) -> Iterator[str]:
    yield f"  {rule.protocol}: {'; '.join(one.text for one in rule.conditions) or 'all other teams'}"
    yield f"      {rule.why}"


class OrderNote:
    """Says once, on standard error, that another order is usually faster than the files', where a run takes long."""

    def __init__(self, team: Team, options: Options) -> None:
        self._team, self._options = team, options
        self._told = False

    def watching(self, show: Callable[[Progress], None] | None) -> Callable[[Progress], None] | None:
        """Return `show`, which shows the progress, and says it after a while."""
        if show is None:
            return None

        def shown(progress: Progress) -> None:
            if progress.messages:
                self.tell_if_late(progress.elapsed_s)
            show(progress)

        return shown

    def tell_if_late(self, seconds: float) -> None:
        """Say it if the search has taken so many `seconds`, and it was not said."""
        if self._told or seconds < LONG_S:
            return
        self._told = True
        order = faster_order(self._team, self._options)
        if order:
            name = on_one_line(self._team.name)
            print_above(
                f"{name}: --order {order} is usually faster than the files'; --protocol auto chooses one itself"
            )
