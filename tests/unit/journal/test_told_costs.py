"""Journals of teams whose costs are not plain: what they say of costs is in the user's numbers."""

from __future__ import annotations

from decimal import Decimal

from robochoc.journal.events import Given, Heard, Improved
from robochoc.journal.given import told_by
from robochoc.journal.journal import Header, read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.model.assembly import assemble
from robochoc.model.costs import normalized
from robochoc.model.expression import Type, parse
from robochoc.model.problem import Constraint, CostUnits, Domain, Function, ProblemKind, Team, Variable
from robochoc.replay.replay import replay
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.verification.objective import Objective


def utilities() -> Team:
    product = Function("product", ("X", "Y"), parse("sub(mul(X,Y),1)", ("X", "Y"), Type.INTEGER))
    values = Domain("D", (range(3),))
    return assemble(
        "utilities",
        {"a": [Variable("x", values)], "b": [Variable("y", values)]},
        [Constraint("C", product, ("x", "y"), ("x", "y"))],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=1, constant=5),
    )


def test_a_journal_tells_costs_as_the_user_counts_them() -> None:
    team = utilities()
    recorder = JournalRecorder(
        Header(team=team.name, protocol="syncbb", runtime="simulator", seed=0), lambda: Objective(normalized(team))
    )
    outcome = solve(team, Options(protocol="syncbb", runtime=Runtime.SIMULATOR), observer=recorder)
    recorder.outcome = outcome
    content = recorder.content()
    journal = read_journal(content)
    assert journal.outcome == outcome
    assert outcome.cost == Decimal("3.5")
    costs = [event.cost for event in journal.events if isinstance(event, Improved)]
    assert costs == sorted(costs)
    assert costs[-1] == Decimal("3.5")
    given = next(event for event in journal.events if isinstance(event, Given))
    heard = [told_by(given, event.cost) for event in journal.events if isinstance(event, Heard)]
    assert heard
    assert heard[-1] == Decimal("3.5")
    assert not replay(journal).contradictions
