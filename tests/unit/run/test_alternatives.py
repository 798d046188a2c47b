"""A refusal names only those who do take the team."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from robochoc.model.problem import Constraint, ConstraintModel, ProblemKind, Relation, Semantics, Team
from robochoc.run import alternatives, solve
from robochoc.run.alternatives import MOST_NAMED
from robochoc.run.options import Options, Runtime, Withdrawal
from robochoc.run.registry import InstalledProtocol, installed_protocols
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exact_costs import EXACT
from tests.support.refusals import costly_team, refusal_of


def partly_known(cost: int) -> Team:
    """Return that team with a partially known constraint, too."""
    part = Constraint(
        "P", Relation("N", 2, Semantics.CONFLICTS, ((0, 0),)), ("A", "C"), ("A", "C"), ConstraintModel.PKC
    )
    team = costly_team(cost)
    last = team["RC"]
    parents = (*last.parents, replace(last.parents[0], name="RA", constraints=(part,)))
    first = team["RA"]
    children = (*first.children, replace(first.children[0], name="RC", constraints=(part,)))
    changed = {"RC": replace(last, parents=parents), "RA": replace(first, children=children)}
    return replace(team, robots=tuple(changed.get(robot.name, robot) for robot in team.robots))


def options_for(name: str, withdraw: Withdrawal | None = None) -> Options:
    return Options(protocol=name, runtime=Runtime.SIMULATOR, withdraw=withdraw, messages=2000, cache=False)


def named(refusal: str) -> list[str]:
    found = re.search(r"; these do: ([a-z0-9, -]+) \(--protocol\)", refusal)
    return found[1].split(", ") if found else []


@pytest.mark.parametrize("name", ["dpop", "sfb"])
@pytest.mark.parametrize("withdraw", [None, Withdrawal.MINIMUM])
def test_whoever_is_named_takes_costs_that_tables_do_not_hold(name: str, withdraw: Withdrawal | None) -> None:
    team = costly_team(EXACT)
    said = refusal_of(team, options_for(name, withdraw))
    assert "costs may add up to 2^53 or more" in said
    assert len(named(said)) == MOST_NAMED
    assert not {"dpop", "sfb"} & set(named(said))
    for other in named(said):
        assert solve(team, options_for(other, withdraw)).cost == 2


def test_a_refusal_names_three_protocols_and_where_to_read_of_the_others() -> None:
    said = refusal_of(partly_known(3), options_for("dpop"))
    assert named(said)[0] == "asym-pt-fb"
    assert re.search(r"\(--protocol\), and \d+ more: 'robochoc protocols' lists them$", said)


def test_what_both_refuse_is_told_of_by_both(monkeypatch: pytest.MonkeyPatch) -> None:
    def only_with_tables() -> list[InstalledProtocol]:
        return [offer for offer in installed_protocols() if offer.name in {"dpop", "sfb"}]

    monkeypatch.setattr(alternatives, "installed_protocols", only_with_tables)
    for name in ("dpop", "sfb"):
        assert refusal_of(costly_team(EXACT), options_for(name)).endswith(
            "; no protocol that is installed does (scale the costs down)"
        )


@pytest.mark.parametrize("team", [costly_team(3), partly_known(3)], ids=["costs", "partly known"])
@pytest.mark.parametrize("withdraw", [None, Withdrawal.MINIMUM])
def test_whoever_is_named_in_any_refusal_takes_the_team(withdraw: Withdrawal | None, team: Team) -> None:
    sent_to: set[str] = set()
    for offer in installed_protocols():
        try:
            solve(team, options_for(offer.name, withdraw))
        except UnsupportedError as refusal:
            sent_to |= set(named(str(refusal))) or {str(refusal).rpartition("; ")[2]}
    alone = {one for one in sent_to if " " in one}
    assert alone <= {"no protocol that is installed does"}
    for other in sent_to - alone:
        solve(team, options_for(other, withdraw))


def test_where_no_protocol_does_the_judge_may(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as where no protocol is installed that takes PKC and minimises."""
    others = [offer for offer in installed_protocols() if not offer.protocol or not offer.protocol.traits.asymmetric]
    monkeypatch.setattr(alternatives, "installed_protocols", lambda: others)
    for kind, asked in ((ProblemKind.DISWCSP, "sfb"), (ProblemKind.DISWCSP, "abt")):
        team = replace(partly_known(3), robots=tuple(replace(one, kind=kind) for one in partly_known(3).robots))
        said = refusal_of(team, Options(protocol=asked))
        assert said.endswith("; no protocol does, but the central solver (--protocol central)")
    assert "central" not in refusal_of(partly_known(2**56), Options(protocol="sfb"))
