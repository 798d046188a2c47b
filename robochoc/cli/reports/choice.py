"""The reasons for choosing a protocol and order (`robochoc solve --explain`), and a note on orders in slow runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from robochoc.cli.reports.progress import print_above
from robochoc.formats import on_one_line
from robochoc.run.choice import ORDERS_TEXT, ProtocolChoice, faster_order
from robochoc.run.choice_rules import RULES, Rule

if TYPE_CHECKING:
    from robochoc.communication.search_result import Progress
    from robochoc.model.problem import Team
    from robochoc.run.options import Options

LONG_S = 5.0
"""The seconds of search after which the note on a faster order is printed."""


def choice_lines(choice: ProtocolChoice) -> Iterator[str]:
    """Yield the facts about the team and the reasons against other protocols; empty if the user chose the protocol."""
    if choice.facts:
        yield f"  the team: {'; '.join(choice.facts)}"
    for name, why in choice.rejected:
        yield on_one_line(f"  not {name}: {why}")


def rules_text() -> str:
    """Return a text with the rules by which a protocol and an order are chosen."""
    head = "auto: not a protocol, but the choice of the first one below that suits the team and supports all options"
    rules = [line for rule in RULES for line in _rule_lines(rule)]
    return "\n".join([head, *rules, *ORDERS_TEXT, "next: robochoc solve --explain shows the choice for a team"])


def _rule_lines(rule: Rule) -> Iterator[str]:
    yield f"  {rule.protocol}: {'; '.join(one.text for one in rule.conditions) or 'all other teams'}"
    yield f"      {rule.why}{f'; order {rule.order}' if rule.order else ''}"


class OrderNote:
    """A note on standard error, printed once in a slow run: another order is usually faster than the files' order."""

    def __init__(self, team: Team, options: Options) -> None:
        self._team, self._options = team, options
        self._printed = False

    def observing(self, show: Callable[[Progress], None] | None) -> Callable[[Progress], None] | None:
        """Return a function that calls `show` with the progress, and prints the note when the run is slow."""
        if show is None:
            return None

        def observe(progress: Progress) -> None:
            if progress.messages:
                self.print_if_slow(progress.elapsed_s)
            show(progress)

        return observe

    def print_if_slow(self, elapsed_s: float) -> None:
        """Print the note if the search is slow and the note has not been printed yet."""
        if self._printed or elapsed_s < LONG_S:
            return
        self._printed = True
        order = faster_order(self._team, self._options)
        if order:
            name = on_one_line(self._team.name)
            print_above(
                f"{name}: --order {order} is usually faster than the order of the files; --protocol auto chooses one"
            )
