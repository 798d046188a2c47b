"""Solutions as HTML for notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from robochoc.formats.headline import describe_outcome
from robochoc.model.cost_units import Cost, cost_shown
from robochoc.model.outcome import Outcome
from robochoc.model.problem import AddAgent, ProblemKind, Team
from robochoc.modelling.html_tables import heading, table
from robochoc.modelling.team_html import shown_values


def solution_html(outcome: Outcome, team: Team | None, values: Mapping[str, object]) -> str:
    """Return the HTML of an outcome: a headline, the user's `values` by variable, the epochs, and the metrics."""
    owner = _owners(team) if team else {}
    plain = team is None or team.kind == ProblemKind.DISCSP
    metrics = outcome.metrics
    spent = {
        "messages": f"{sum(metrics.messages.values()):,}",
        "bytes": f"{metrics.bytes:,}",
        "NCCCs": f"{metrics.ncccs:,}",
        "checks": f"{metrics.checks:,}",
        "seconds": f"{metrics.wall_s:.3f}",
    }
    epochs = [
        (number, epoch.opened_by, len(epoch.robots), epoch.verdict, _cost(epoch.cost, plain=plain))
        for number, epoch in enumerate(outcome.epochs)
    ]
    robots = len(team.robots) if team else len({owner.get(name, name) for name in outcome.assignment})
    parts = (
        heading(
            f"{outcome.team}: {describe_outcome(outcome, robots)}",
            f"{outcome.protocols}, {outcome.runtime}{', verified' if outcome.verified else ''}",
        ),
        table(
            ("robot", "variable", "value"),
            [(owner.get(name, ""), name, shown_values([value])) for name, value in values.items()],
        ),
        table(("withdrawn",), [(name,) for name in outcome.withdrawn]),
        table(("epoch", "opened by", "robots", "verdict", "cost"), epochs),
        table(tuple(spent), [tuple(spent.values())]),
    )
    return f"<div>{''.join(parts)}</div>"


def _cost(cost: Cost | None, *, plain: bool) -> str:
    return "" if cost is None or plain else cost_shown(cost)


def _owners(team: Team) -> dict[str, str]:
    """Return the robot of each variable, including robots that join later."""
    changes = [change for event in team.scenario for change in event.changes]
    joining = [change.robot for change in changes if isinstance(change, AddAgent)]
    return {**team.owner, **{one.name: robot.name for robot in joining for one in robot.variables}}


def framed(page: str, height: int) -> str:
    """Return `page` as a sandboxed frame for another page."""
    return (
        f'<iframe srcdoc="{escape(page)}" sandbox="allow-scripts" style="width:100%;height:{height}px;border:0"'
        ' title="the scene"></iframe>'
    )
