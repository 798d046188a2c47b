"""A refusal names only those who do take the team."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.communication.simulator.channel import CHANNELS
from robochoc.journal.entries import Header
from robochoc.journal.journal import JournalRecorder
from robochoc.journal.reader import read_journal
from robochoc.model.problem import Constraint, ConstraintModel, ProblemKind, Relation, Semantics, Team
from robochoc.run import alternatives, solve
from robochoc.run.alternatives import MOST_NAMED
from robochoc.run.compatibility import refuse_options
from robochoc.run.options import OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.run.registry import InstalledProtocol, installed_protocols
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.exact_costs import EXACT
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of
from tests.support.program import ROOT


def dear(cost: int, pairs: str = "AB BC") -> Team:
    """Robots with two values each; that two who share a constraint have the same one costs `cost`, or one more."""
    tuples = ((0, 0), (1, 1))
    price = Relation("R", 2, Semantics.SOFT, tuples, (cost, cost + 1), 1)
    constraints = [Constraint(pair, price, tuple(pair), tuple(pair)) for pair in pairs.split()]
    return with_costs(team_of(dict.fromkeys("ABC", (0, 1)), constraints))


def partly_known(cost: int) -> Team:
    """The same, and a partially known constraint."""
    part = Constraint(
        "P", Relation("N", 2, Semantics.CONFLICTS, ((0, 0),)), ("A", "C"), ("A", "C"), ConstraintModel.PKC
    )
    team = dear(cost)
    last = team["RC"]
    parents = (*last.parents, replace(last.parents[0], name="RA", constraints=(part,)))
    first = team["RA"]
    children = (*first.children, replace(first.children[0], name="RC", constraints=(part,)))
    changed = {"RC": replace(last, parents=parents), "RA": replace(first, children=children)}
    return replace(team, robots=tuple(changed.get(robot.name, robot) for robot in team.robots))


def options_for(name: str, withdraw: Withdrawal | None = None) -> Options:
    return Options(protocol=name, runtime=Runtime.SIMULATOR, withdraw=withdraw, messages=2000, cache=False)


def refused(team: Team, options: Options) -> str:
    with pytest.raises(UnsupportedError) as refusal:
        solve(team, options)
    return str(refusal.value)


def named(refusal: str) -> list[str]:
    found = re.search(r"; these do: ([a-z0-9, -]+) \(--protocol\)", refusal)
    return found[1].split(", ") if found else []


@pytest.mark.parametrize("name", ["dpop", "sfb"])
@pytest.mark.parametrize("withdraw", [None, Withdrawal.MINIMUM])
def test_whoever_is_named_takes_costs_that_tables_do_not_hold(name: str, withdraw: Withdrawal | None) -> None:
    team = dear(EXACT)
    said = refused(team, options_for(name, withdraw))
    assert "costs could add up to 2^53 or more" in said
    assert len(named(said)) == MOST_NAMED
    assert not {"dpop", "sfb"} & set(named(said))
    for other in named(said):
        assert solve(team, options_for(other, withdraw)).cost == 2


def test_a_refusal_names_three_protocols_and_where_to_read_of_the_others() -> None:
    said = refused(partly_known(3), options_for("dpop"))
    assert named(said)[0] == "asym-pt-fb"
    assert re.search(r"\(--protocol\), and \d+ more: docs/guides/which-protocol\.md$", said)
    assert (ROOT / alternatives.GUIDE).is_file()


def test_what_both_refuse_is_told_of_by_both(monkeypatch: pytest.MonkeyPatch) -> None:
    def only_with_tables() -> list[InstalledProtocol]:
        return [offer for offer in installed_protocols() if offer.name in {"dpop", "sfb"}]

    monkeypatch.setattr(alternatives, "installed_protocols", only_with_tables)
    for name in ("dpop", "sfb"):
        assert refused(dear(EXACT), options_for(name)).endswith(
            "; no protocol that is installed does (scale the costs down)"
        )


@pytest.mark.parametrize("team", [dear(3), partly_known(3)], ids=["costs", "partly known"])
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
        said = refused(team, Options(protocol=asked))
        assert said.endswith("; no protocol does, but the central solver (--protocol central)")
    assert "central" not in refused(partly_known(2**31), Options(protocol="sfb"))


WLAN = CHANNELS["wlan"]
REFUSED_OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"runtime": Runtime.ARRAYS}, "sfb has no form as arrays; add --runtime simulator, or choose a protocol"),
    ({"runtime": Runtime.ARRAYS, "protocol": "dsa", "withdraw": Withdrawal.MAXIMAL}, "--withdraw is settled by"),
    ({"runtime": Runtime.ARRAYS, "delay": 3}, "--delay and --schedule are the simulator's"),
    ({"runtime": Runtime.ARRAYS, "ncccs": 3}, "--ncccs is a limit for the simulator"),
    ({"runtime": Runtime.ARRAYS, "patience": 3.0}, "--patience is for robots with processes"),
    ({"runtime": Runtime.ARRAYS, "spares": 1}, "--on-loss and --spare are for processes, which can die"),
    ({"runtime": Runtime.ARRAYS, "kill": (Kill("RA", 1),)}, "the simulator and arrays have none"),
    ({"runtime": Runtime.ARRAYS, "filters": ("signed",)}, "--filter is for messages that cross a network"),
    ({"channel": WLAN, "runtime": Runtime.PROCESSES}, "add --runtime simulator"),
    ({"channel": WLAN, "delay": 3}, "drop --delay and --schedule"),
    ({"delay": 3, "runtime": Runtime.PROCESSES}, "--delay and --schedule are the simulator's"),
    ({"delay": 3, "schedule": ScheduleName.RANDOM}, "--delay is for --schedule concurrent"),
    ({"protocol": "central", "verify": True}, "--verify asks the central solver"),
    ({"patience": 1.0}, "--patience is for robots with processes"),
    ({"protocol": "central", "messages": 5}, "--messages is for robots"),
    ({"protocol": "central", "order": ("RA", "RB")}, "--order is for robots"),
    ({"protocol": "central", "settings": {"cycles": "5"}}, "--set is for robots"),
    ({"protocol": "central", "withdraw": Withdrawal.MAXIMAL}, "finds a minimum; --withdraw minimum"),
    ({"protocol": "central", "count": True, "withdraw": Withdrawal.MINIMUM}, "who can do without"),
    ({"filters": ("signed",)}, "add --runtime network"),
    ({"spares": 1, "runtime": Runtime.NETWORK}, "drop --runtime network"),
    ({"on_loss": OnLoss.WITHDRAW}, "for processes, which can die"),
    ({"spares": 1, "on_loss": OnLoss.FAIL, "runtime": Runtime.PROCESSES}, "--on-loss fail ends the run instead"),
]


@pytest.mark.parametrize(("options", "said"), REFUSED_OPTIONS, ids=[said for _, said in REFUSED_OPTIONS])
def test_options_that_do_not_go_together_are_refused_in_python_too(options: dict[str, Any], said: str) -> None:
    assert said in refused(dear(3), Options(**{"protocol": "sfb", "runtime": Runtime.SIMULATOR, **options}))


def test_no_rule_refuses_the_defaults() -> None:
    for runtime in Runtime:
        refuse_options(Options(runtime=runtime), environment=runtime not in {Runtime.NETWORK, Runtime.ARRAYS})
    refuse_options(Options(protocol="central", count=True))


@pytest.mark.parametrize("seed", [2**64, -(2**63) - 1])
def test_a_seed_has_64_bits_as_journals_and_networks_tell_it(seed: int) -> None:
    with pytest.raises(UnsupportedError, match="--seed is a number of 64 bits"):
        refuse_options(Options(seed=seed))


@pytest.mark.parametrize("seed", [2**64 - 1, -(2**63)])
def test_the_largest_seeds_can_be_recorded(seed: int) -> None:
    refuse_options(Options(seed=seed))
    recorder = JournalRecorder(Header(team="team", protocol="abt", runtime="simulator", seed=seed))
    recorder.flush()
    assert read_journal(recorder.content()).header.seed == seed
