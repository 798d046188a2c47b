"""Asymmetric costs (Grinshpoun et al., JAIR 47, 2013): what every protocol for them promises."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.choice import accepts, choose
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.asymmetric_bytes import costs_changed, watched_costs, watched_entries, what_is_not_needed_changed
from tests.support.asymmetric_problems import check_asymmetric, random_asymmetric_team, random_pkc_options
from tests.support.cases import looped
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.loose_problems import minimum_cost
from tests.support.pkc_bytes import nothing_hidden, run
from tests.support.spent import spent

ASYMMETRIC = [name for name in protocol_names() if protocol_named(name).traits.asymmetric]
COMPLETE = [name for name in ASYMMETRIC if protocol_named(name).traits.complete]
INCOMPLETE = [name for name in ASYMMETRIC if name not in COMPLETE]
FORMS: list[tuple[str, dict[str, str]]] = [(name, {}) for name in COMPLETE] + [("syncabb", {"phases": "2"})]
"""Complete protocols, and settings with which they search in another way."""
LOOKS: list[tuple[str, dict[str, str]]] = [form for form in FORMS if form[0] == "syncabb"]
LOOKS += [(name, {} if name == "cocoa" else {"cycles": "3"}) for name in INCOMPLETE]
"""Those that look at an entry of a part only when the other robot has its value, proposes it or answers with it."""


@count("teams", 12, 2000)
@looped(("protocol", "settings"), FORMS)
def test_the_least_sum_of_both_sides_is_found(protocol: str, settings: dict[str, str], teams: int) -> None:
    chance = Random(f"asymmetric {protocol} {settings}")
    seen = Counter(check_asymmetric(protocol, chance, settings=settings).verdict for _ in range(teams))
    assert seen[Verdict.OPTIMAL] > teams // 3
    assert seen[Verdict.NO_SOLUTION] or teams < 100


@count("teams", 1, 80)
def test_it_is_found_in_processes(teams: int) -> None:
    chance = Random("asymmetric processes")
    for number in range(teams):
        protocol, settings = FORMS[number % len(FORMS)]
        check_asymmetric(protocol, chance, Options(timeout=HANG_S), settings=settings)


@count("teams", 6, 100)
@looped(("protocol", "settings"), FORMS)
def test_as_few_as_possible_withdraw(protocol: str, settings: dict[str, str], teams: int) -> None:
    """The central solver finds as many; of those who stay, the cost is the least."""
    chance = Random(f"asymmetric withdraw {protocol}")
    withdrawn = 0
    for _ in range(teams):
        team = random_asymmetric_team(chance)
        options = replace(random_pkc_options(team, protocol, chance), withdraw=Withdrawal.MINIMUM, settings=settings)
        outcome = solve(team, options)
        central = solve(team, Options(protocol="central", withdraw=Withdrawal.MINIMUM, timeout=HANG_S))
        assert (len(outcome.withdrawn), outcome.cost) == (len(central.withdrawn), central.cost)
        assert outcome.verified
        withdrawn += bool(outcome.withdrawn)
    assert withdrawn < teams
    assert withdrawn or teams < 100


@count("teams", 10, 200)
@looped("protocol", INCOMPLETE)
def test_what_is_not_proven_is_no_better_than_the_least(protocol: str, teams: int) -> None:
    chance = Random(f"asymmetric incomplete {protocol}")
    solved = 0
    for _ in range(teams):
        team = random_asymmetric_team(chance)
        cost = minimum_cost(team)
        settings = {} if protocol == "cocoa" else {"cycles": "25"}
        outcome = solve(team, replace(random_pkc_options(team, protocol, chance), settings=settings))
        assert outcome.verdict is not Verdict.OPTIMAL
        assert cost < INFINITE or outcome.cost is None
        if outcome.cost is not None:
            assert outcome.cost >= cost
            assert outcome.verified
            solved += 1
    assert solved > teams // 3


def test_they_accept_such_teams_and_refusals_name_one_that_does() -> None:
    team = random_asymmetric_team(Random(1))
    options = Options(protocol="dpop", runtime=Runtime.SIMULATOR)
    assert [name for name in protocol_names() if accepts(name, team, options)] == ASYMMETRIC
    with pytest.raises(Exception, match="which dpop does not support; these do: asym-pt-fb, "):
        solve(team, options)


def test_auto_takes_local_search_only_where_a_proof_takes_too_long_and_nobody_withdraws() -> None:
    """4^13 combinations are fewer than a hundred millions, and 4^14 are more."""

    def taken(team: Team, withdraw: Withdrawal | None = None) -> str:
        return choose(team, Options(protocol="auto", withdraw=withdraw)).options.protocol

    chance = Random("auto")
    assert {taken(random_asymmetric_team(chance)) for _ in range(5)} <= {*COMPLETE}
    smaller, larger = (random_csp(robots, 4, 0.4, 0, max_cost=20, asymmetric=True) for robots in (13, 14))
    assert (taken(smaller), taken(larger)) == ("asym-pt-fb", "acls")
    assert taken(larger, Withdrawal.MINIMUM) in COMPLETE


@looped(("protocol", "messages", "checks"), [("asym-pt-fb", 4, 5), ("atwb", 3, 5)])
def test_it_needs_fewer_messages_and_checks_than_syncabb(protocol: str, messages: int, checks: int) -> None:
    """The papers' point."""
    teams = [random_csp(6, 3, 0.6, 0, seed, connected=True, max_cost=20, asymmetric=True) for seed in range(3)]
    ours, syncabb = spent(teams, protocol), spent(teams, "syncabb")
    assert messages * ours.messages < syncabb.messages
    assert checks * ours.ncccs < syncabb.ncccs


# What is said


@plain_python_only
@count("teams", 8, 100)
@looped(("protocol", "settings"), LOOKS)
def test_entries_that_nobody_looks_at_change_no_byte(protocol: str, settings: dict[str, str], teams: int) -> None:
    chance = Random(f"bytes {protocol}")
    changed = 0
    for seed in range(teams):
        team = random_asymmetric_team(chance, simple=True)
        with pytest.MonkeyPatch.context() as patch:
            asked = watched_costs(team, patch)
            before = run(team, protocol_named(protocol), seed, settings)
        nothing_hidden(protocol_named(protocol), before.envelopes)
        elsewhere = costs_changed(team, asked, chance)
        assert run(elsewhere, protocol_named(protocol), seed, settings).envelopes == before.envelopes
        there = costs_changed(team, asked, chance, there=True)
        changed += run(there, protocol_named(protocol), seed, settings).envelopes != before.envelopes
    assert changed > teams // 2


@plain_python_only
@count("teams", 8, 100)
@looped("protocol", ["asym-pt-fb", "atwb"])
def test_what_a_robot_does_not_need_of_its_part_changes_no_message(protocol: str, teams: int) -> None:
    """Towards robots below or after it: all but the least entry of each own value, and those that it was asked for."""
    chance, kind = Random(f"bytes {protocol}"), protocol_named(protocol)
    others = 0
    for seed in range(teams):
        team = random_asymmetric_team(chance, simple=True)
        above = above_in_tree(team, seed) if protocol == "asym-pt-fb" else None
        with pytest.MonkeyPatch.context() as patch:
            asked = watched_entries(team, patch, above)
            before = run(team, kind, seed)
        nothing_hidden(kind, before.envelopes)
        elsewhere = what_is_not_needed_changed(team, asked, chance, above)
        others += elsewhere != team
        again = run(elsewhere, kind, seed)
        sent, before_sent = ([(e.sender, e.receiver, e.content) for e in one.envelopes] for one in (again, before))
        assert sent == before_sent
    assert others > teams // 2


def above_in_tree(team: Team, seed: int) -> dict[str, set[str]]:
    above = {name: set[str]() for name in team.order}
    for name, findings in run(team, protocol_named("asym-pt-fb"), seed).result.findings.items():
        if findings.place is not None and findings.place.parent is not None:
            above[name] = {findings.place.parent, *findings.place.pseudo_parents}
    return above
