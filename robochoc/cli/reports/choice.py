"""The choice of a protocol, for people (`robochoc solve --explain`)."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.formats import on_one_line
from robochoc.run.choice import Choice


def choice_lines(choice: Choice) -> Iterator[str]:
    """Yield why protocol and order were chosen, the facts, and why others were not; nothing where all was asked for."""
    options = choice.options
    chosen = {"protocol": options.protocol, "order": str(options.order)}
    for what, why in options.chosen.items():
        yield on_one_line(f"  {what} {chosen[what]}: {why}")
    if choice.facts:
        yield f"  the team: {'; '.join(choice.facts)}"
    for name, why in choice.rejected:
        yield on_one_line(f"  not {name}: {why}")
