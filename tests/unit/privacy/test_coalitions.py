"""Tables that coalitions can exclude: by protocols that disclose much, and by those that hide everything."""

from __future__ import annotations

import itertools
from random import Random

import pytest

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.privacy import PrivacyError, coalition_report
from robochoc.privacy.coalitions import CoalitionReport
from robochoc.protocols.private.p_dsa import PDSA, PDSASettings
from robochoc.protocols.private.p_maxsum import PMaxSum, PMaxSumSettings
from robochoc.protocols.private.p_mgm import PMGM
from robochoc.protocols.private.pc_syncbb import PCSyncBB, PCSyncBBSettings, Search
from robochoc.protocols.private.shamir import Field, field_of
from robochoc.protocols.private.shared_search import SearchSettings, SharedSearchProtocol
from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import RunParameters
from tests.support.cost_problems import with_costs
from tests.support.examples import count, drawn
from tests.support.private_problems import priced
from tests.support.problems import team_of

SLOW = pytest.mark.slow


class HiddenSearch(PCSyncBB):
    """A hidden search in a small field, which is faster."""

    settings = PCSyncBBSettings(search=Search.HIDDEN)

    @property
    def field(self) -> Field:
        return field_of(19)


class LargeField(HiddenSearch):
    """A hidden search of larger teams."""

    @property
    def field(self) -> Field:
        return field_of(31)


class SmallField(SharedSearchProtocol):
    """A private search in cycles in a small field."""

    @property
    def field(self) -> Field:
        return field_of(19)


class SmallPDSA(SmallField, PDSA):
    """P-DSA in a small field."""

    settings = PDSASettings(probability=1, cycles=2)


class SmallPMGM(SmallField, PMGM):
    """P-MGM in a small field."""

    settings = SearchSettings(cycles=2)


class SmallPMaxSum(SmallField, PMaxSum):
    """P-Max-Sum in a small field, without preferences."""

    settings = PMaxSumSettings(cycles=1, preference=0)


def measured(team: Team, protocol: str | type[Protocol], size: int = 1, *, coins: int = 1) -> CoalitionReport:
    offered = protocol_named(protocol) if isinstance(protocol, str) else protocol
    settings = {"cycles": "3"} if hasattr(offered.settings, "cycles") and not offered.traits.secret_keys else {}
    return coalition_report(team, offered, size, parameters=RunParameters(0, settings), coins=coins, costs=(0, 1))


def random_costs(chance: Random, robots: int = 3) -> Team:
    """Return a team of robots with two values each; most pairs of robots share costs of 0 and 1."""
    names = "ABCDE"[:robots]
    pairs = [pair for pair in itertools.combinations(names, 2) if chance.random() < 0.8] or [("A", "B")]
    rows = [(one, two) for one in (1, 2) for two in (1, 2)]
    return with_costs(
        team_of(
            dict.fromkeys(names, (1, 2)), [priced(*pair, {row: chance.randrange(2) for row in rows}) for pair in pairs]
        )
    )


CHAIN = with_costs(
    team_of(
        dict.fromkeys("ABC", (1, 2)),
        [
            priced("A", "B", {(1, 1): 1, (1, 2): 0, (2, 1): 0, (2, 2): 1}),
            priced("B", "C", {(1, 1): 0, (1, 2): 1, (2, 1): 1, (2, 2): 0}),
        ],
    )
)
"""B shares a constraint with A, and one with C."""


def test_a_coalition_that_shares_all_constraints_has_nothing_to_learn() -> None:
    report = measured(CHAIN, "syncbb")
    assert [one.members for one in report.losses] == [("RA",), ("RC",)]
    assert {one.tables for one in report.losses} == {16}


def test_dpop_and_syncbb_disclose_more_than_the_answer() -> None:
    for protocol in ("dpop", "syncbb"):
        report = measured(random_costs(Random(1)), protocol)
        assert report.is_exact
        assert any(one.by_messages < one.by_values for one in report.losses), protocol


def test_true_tables_are_never_excluded() -> None:
    for protocol in ("syncbb", "dpop", "adopt", "mgm"):
        assert all(one.by_messages >= 1 for one in measured(CHAIN, protocol).losses)


def test_more_seeds_exclude_fewer_tables() -> None:
    few, many = (sum(one.by_messages for one in measured(CHAIN, "mgm", coins=coins).losses) for coins in (1, 8))
    assert few <= many


def test_a_table_with_which_the_run_is_refused_is_excluded() -> None:
    class Limited(PCSyncBB):
        settings = PCSyncBBSettings(comparisons=4)

        @property
        def field(self) -> Field:
            return field_of(19)

    zeros = [priced(one, "B", {(1, two): 0 for two in (1, 2)}) for one in "AC"]
    team = with_costs(team_of({"A": (1,), "B": (1, 2), "C": (1,)}, zeros))
    for one in coalition_report(team, Limited, 1, costs=(0, 1)).losses:
        assert 1 <= one.by_messages <= one.by_values < one.tables


@pytest.mark.parametrize(
    "seeds", [range(1), *(pytest.param(range(at, at + 10), marks=SLOW) for at in range(0, 200, 10))]
)
def test_a_hidden_search_discloses_nothing_to_minorities(seeds: range) -> None:
    """No coalition of a minority can exclude a table, except by its own values in the answer."""
    for seed in seeds:
        report = measured(random_costs(drawn(f"coalitions {seed}")), HiddenSearch)
        assert [one.excluded_by_messages for one in report.losses] == [0] * len(report.losses)


@pytest.mark.parametrize("protocol", [SmallPDSA, SmallPMGM, SmallPMaxSum])
@count("number", fast=1, slow=20)
def test_a_private_search_in_cycles_discloses_nothing_to_minorities(number: int, protocol: type[SmallField]) -> None:
    for seed in range(number):
        report = measured(random_costs(drawn(f"local {seed}")), protocol)
        assert [one.excluded_by_messages for one in report.losses] == [0] * len(report.losses)


@pytest.mark.slow
def test_neither_to_two_of_five() -> None:
    chance = drawn("two of five")
    domains = {**dict.fromkeys("ABC", (1, 2)), "D": (1,), "E": (1,)}
    pairs = [
        priced(one, two, {row: chance.randrange(2) for row in itertools.product(domains[one], domains[two])})
        for one, two in ("AB", "BC", "CD")
    ]
    for one in measured(with_costs(team_of(domains, pairs)), LargeField, 2).losses:
        assert one.excluded_by_messages == 0


@pytest.mark.slow
def test_an_open_search_discloses_how_it_proceeds_and_less_than_syncbb() -> None:
    shares = {}
    for protocol in ("syncbb", "pc-syncbb"):
        teams = [random_costs(Random(seed)) for seed in range(2)]
        losses = [one for team in teams for one in measured(team, protocol, coins=4).losses]
        shares[protocol] = sum(one.by_messages for one in losses)
    assert shares["pc-syncbb"] > shares["syncbb"]


def test_satisfaction_has_allowed_and_forbidden_pairs() -> None:
    differ = Relation("differ", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    team = team_of(
        dict.fromkeys("ABC", (1, 2)), [Constraint("c", differ, pair, pair) for pair in (("A", "B"), ("B", "C"))]
    )
    report = coalition_report(team, protocol_named("abt"), 1)
    assert [one.tables for one in report.losses] == [2**4] * 2
    assert coalition_report(team, protocol_named("abt"), 2).losses == ()


@pytest.mark.more
def test_every_protocol_is_measured_or_refused_in_one_sentence() -> None:
    refused = set()
    for name in protocol_names():
        traits = protocol_named(name).traits
        if traits.costs and not traits.allocates and not traits.lacks:
            try:
                assert all(one.by_messages for one in measured(CHAIN, name).losses), name
            except PrivacyError as why:
                refused.add((name, str(why)[:30]))
    assert refused == {(name, "the protocol draws secret keys") for name in ("p-dpop", "p2-dpop", "p32-dpop")}


def test_what_cannot_be_measured_is_refused() -> None:
    for size, protocol, why in (
        (3, "dpop", "a coalition of 3 robots leaves none of 3"),
        (2, "pc-syncbb", "fewer than half of the 3 robots"),
        (1, "p-dpop", "draws secret keys"),
    ):
        with pytest.raises(PrivacyError, match=why):
            measured(CHAIN, protocol, size)
    wide = with_costs(team_of(dict.fromkeys("ABC", tuple(range(5))), [priced("B", "C", {(1, 1): 9})]))
    with pytest.raises(PrivacyError, match=r"25 secret entries of 11 possible costs, more than 100,000 tables"):
        coalition_report(wide, protocol_named("dpop"), 1)
