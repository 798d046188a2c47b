"""One test per rule of ACLS, MCS-MGM and GCA-MGM (Grinshpoun et al., JAIR 47, 2013), named for it."""

from __future__ import annotations

import itertools
from functools import partial

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.protocols.asymmetric.acls import ACLS, ACLSSettings, Proposal, Sides
from robochoc.protocols.asymmetric.gca_mgm import GCAMGM
from robochoc.protocols.asymmetric.mcs_mgm import MCSMGM, Transfer
from robochoc.protocols.local_search.mgm import Gain
from robochoc.protocols.message import Message
from robochoc.protocols.shared.cycles import NO_GAIN, Value
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.local_problem import LexicographicCost
from tests.support.agents import after, assert_refused, replies, started_robot, value
from tests.support.asymmetric_problems import divided_pair as pair
from tests.support.cases import looped
from tests.support.examples import count

TRANSFERS = looped("protocol", [MCSMGM, GCAMGM])


# ACLS


def proposing(*chances: float) -> ACLS:
    """A, with the value 1, which has proposed 2, where B has 1."""
    robot = started_robot(ACLS, pair(), "RA", chances=(0.0, *chances))
    assert replies(robot, ("RB", Value((1,)))) == [("RB", Proposal((2,)))]
    return robot


def test_a_robot_proposes_a_value_that_improves_its_own_side_or_says_that_none_does() -> None:
    assert proposing().proposal == 1
    robot = started_robot(ACLS, pair(), "RB")
    assert replies(robot, ("RA", Value((1,)))) == [("RA", Proposal(None))]
    assert replies(robot, ("RA", Proposal((2,)))) == [("RA", Sides((0, 0), (0, 5)))], "the own side: now, and with it"


@looped(
    ("now", "proposed", "lot", "moves"),
    [
        ((0, 0), (0, 2), 0.0, True),
        ((0, 0), (0, 3), 0.0, True),
        ((0, 0), (0, 4), 0.0, False),
        ((0, 0), (0, 2), 0.5, False),
        ((0, 9), (0, 11), 0.49, True),
        ((0, 100), (1, 0), 0.0, False),  # it breaks more
    ],
)
def test_a_proposal_that_is_cheap_enough_for_both_is_taken_with_a_probability(
    now: LexicographicCost,
    proposed: LexicographicCost,
    lot: float,
    moves: bool,  # noqa: FBT001
) -> None:
    robot = after(proposing(0.0, lot), ("RB", Proposal(None)))
    replies(robot, ("RB", Sides(now, proposed)))
    assert value(robot) == ((2,) if moves else (1,))


@looped("wrong", [{"coordination": 0.0}, {"coordination": 1.1}, {"probability": 0.0}])
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="it must be more than 0 and at most 1"):
        ACLSSettings(**wrong)  # type: ignore[arg-type] # none of them is the number of cycles


def test_what_the_neighbour_cannot_have_or_take_is_refused() -> None:
    wrong: tuple[tuple[int, ...], ...] = ((), (1, 1), (3,))
    for protocol in (ACLS, MCSMGM, GCAMGM):
        said = [("RB", message) for message in (*map(Value, wrong), Gain(0, 1))]
        assert_refused(partial(started_robot, protocol, pair(), "RA"), said, "RB")
    assert_refused(proposing, [("RB", Proposal(proposed)) for proposed in wrong], "RB")


# Transfers


def moved(protocol: type[MCSMGM], gained: int) -> list[tuple[str, Message]]:
    """Return the messages of B = 1 when A has gone from 1 to 2, which costs B 5, after it announced that gain."""
    robot = started_robot(protocol, pair(), "RB")
    for said in (Value((1,)), Transfer(None), Gain(0, gained)):
        replies(robot, ("RA", said))
    return replies(robot, ("RA", Value((2,))))


def test_who_loses_too_much_by_a_move_hands_over_its_entry() -> None:
    assert moved(MCSMGM, 4) == moved(GCAMGM, 4) == moved(GCAMGM, 5) == [("RA", Transfer((0, 5)))]
    assert moved(MCSMGM, 5) == [("RA", Transfer(None))]
    for protocol in (MCSMGM, GCAMGM):
        said = replies(started_robot(protocol, pair(), "RB"), ("RA", Value((2,))))
        assert said == [("RA", Transfer(None))], "no robot has moved before"


@TRANSFERS
def test_who_is_handed_an_entry_pays_it_and_what_is_no_gain_is_refused(protocol: type[MCSMGM]) -> None:
    robot = after(started_robot(protocol, pair(), "RA"), ("RB", Value((1,))))
    assert replies(robot, ("RB", Transfer(None))) == [("RB", Gain(0, 3))]
    assert replies(robot, ("RB", Gain(0, 0))) == [("RB", Value((2,)))]
    replies(robot, ("RB", Value((1,))))
    assert replies(robot, ("RB", Transfer((0, 5)))) == [("RB", Gain(0, 2))]
    with pytest.raises(ValueError, match="RA"):
        replies(robot, ("RB", Value((1,))))


@TRANSFERS
@count("teams", 3, 60)
def test_what_both_sides_pay_together_never_changes(protocol: type[MCSMGM], teams: int) -> None:
    handed_over = 0
    for seed in range(teams):
        team = random_csp(6, 3, 0.7, 0, seed, max_cost=30, asymmetric=True)
        parameters = RunParameters(seed, {"cycles": "40"})
        with Simulation(team, protocol, RandomChannels(seed), parameters=parameters) as session:
            session.search()
            robots = {name: host.protocol for name, host in session._hosts.items()}  # noqa: SLF001 - what each robot knows
        for one, other in itertools.combinations(robots.values(), 2):
            assert isinstance(one, MCSMGM)
            assert isinstance(other, MCSMGM)
            for (index, seen), cost in one.changed.get(other.problem.agent, {}).items():
                mirrored = (other.problem.values.index(seen), one.problem.values[index])
                back = other.changed[one.problem.agent].get(mirrored, NO_GAIN)
                assert (cost[0] + back[0], cost[1] + back[1]) == (0, 0)
                handed_over += cost != NO_GAIN
    assert handed_over


@count("teams", 4, 300)
def test_gca_mgm_converges(teams: int) -> None:
    for seed in range(teams):
        team = random_csp(6, 3, 0.7, 0, seed, max_cost=30, asymmetric=True)
        result = Simulation(team, GCAMGM, RandomChannels(seed), parameters=RunParameters(seed)).search()
        trails = [found.trail for found in result.findings.values() if found.trail]
        assert len(trails) == 6
        assert max(trail.entries[-1][0] for trail in trails) < 90
