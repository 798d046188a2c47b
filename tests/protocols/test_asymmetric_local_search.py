"""One test per rule of ACLS, MCS-MGM and GCA-MGM (Grinshpoun et al., JAIR 47, 2013), named for it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.assembly import Extras, assemble
from robochoc.model.message import Message
from robochoc.model.problem import Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable
from robochoc.protocols.asymmetric.acls import ACLS
from robochoc.protocols.asymmetric.gca_mgm import GCAMGM
from robochoc.protocols.asymmetric.mcs_mgm import MCSMGM
from robochoc.protocols.asymmetric.messages.acls import Proposal, Sides
from robochoc.protocols.asymmetric.messages.transfers import Transfer
from robochoc.protocols.asymmetric.settings.acls import ACLSSettings
from robochoc.protocols.local_search.messages.mgm import Gain
from robochoc.protocols.shared.cycles import NO_GAIN, CycleProtocol
from robochoc.protocols.shared.messages.cycles import Value
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import replies, robot_of, started, value
from tests.support.examples import count

TRANSFERS = pytest.mark.parametrize("protocol", [MCSMGM, GCAMGM])


def part(costs: Mapping[tuple[int, int], int]) -> Constraint:
    relation = Relation("R", 2, Semantics.SOFT, tuple(costs), tuple(costs.values()), 0)
    return Constraint("C", relation, ("A", "B"), ("A", "B"))


def pair() -> Team:
    """A pays 1 for each 1 of its own, and B pays 5 for A's 2, where its own is 1."""
    parts = {"RA": [part({(1, 1): 3, (1, 2): 1})], "RB": [part({(2, 1): 5, (1, 2): 2, (2, 2): 9})]}
    own = {f"R{name}": [Variable(name, Domain("D", (range(1, 3),)))] for name in "AB"}
    return assemble("pair", own, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts))


# ACLS


def proposing(*chances: float) -> ACLS:
    """A, with the value 1, which has proposed 2, where B has 1."""
    robot = robot_of(ACLS, pair(), "RA", 0.0, *chances)
    started(robot)
    assert replies(robot, ("RB", Value((1,)))) == [("RB", Proposal((2,)))]
    return robot


def test_a_robot_proposes_a_value_that_improves_its_own_side() -> None:
    assert proposing().proposal == 1


def test_who_cannot_improve_its_own_side_says_so() -> None:
    robot = robot_of(ACLS, pair(), "RB", 0.0)
    started(robot)
    assert replies(robot, ("RA", Value((1,)))) == [("RA", Proposal(None))]


def test_neighbours_tell_their_own_side_now_and_with_the_proposal() -> None:
    robot = robot_of(ACLS, pair(), "RB", 0.0)
    started(robot)
    replies(robot, ("RA", Value((1,))))
    assert replies(robot, ("RA", Proposal((2,)))) == [("RA", Sides((0, 0), (0, 5)))]


@pytest.mark.parametrize(
    ("now", "proposed", "lot", "moves"),
    [(0, 2, 0.0, True), (0, 3, 0.0, True), (0, 4, 0.0, False), (0, 2, 0.5, False), (9, 11, 0.49, True)],
)
def test_a_proposal_that_is_cheap_enough_for_both_is_taken_with_a_probability(
    now: int,
    proposed: int,
    lot: float,
    moves: bool,  # noqa: FBT001
) -> None:
    robot = proposing(0.0, lot)
    replies(robot, ("RB", Proposal(None)))
    replies(robot, ("RB", Sides((0, now), (0, proposed))))
    assert value(robot) == ((2,) if moves else (1,))


def test_a_proposal_that_breaks_more_is_not_taken() -> None:
    robot = proposing()
    replies(robot, ("RB", Proposal(None)))
    replies(robot, ("RB", Sides((0, 100), (1, 0))))
    assert value(robot) == (1,)


@pytest.mark.parametrize("wrong", [{"coordination": 0.0}, {"coordination": 1.1}, {"probability": 0.0}])
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="it must be more than 0 and at most 1"):
        ACLSSettings(**wrong)  # type: ignore[arg-type] # none of them is the number of cycles


@pytest.mark.parametrize("protocol", [ACLS, MCSMGM, GCAMGM])
@pytest.mark.parametrize("said", [Value(()), Value((1, 1)), Value((3,)), Gain(0, 1)])
def test_what_is_no_value_of_the_neighbour_is_refused(protocol: type[CycleProtocol], said: Message) -> None:
    robot = robot_of(protocol, pair(), "RA", 0.0)
    started(robot)
    with pytest.raises(ValueError, match="RB"):
        replies(robot, ("RB", said))


@pytest.mark.parametrize("said", [(), (1, 1), (3,)])
def test_a_proposal_that_the_neighbour_cannot_take_is_refused(said: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="RB"):
        replies(proposing(), ("RB", Proposal(said)))


# Transfers


def moved(protocol: type[MCSMGM], gained: int) -> list[tuple[str, object]]:
    """Return the messages of B = 1 when A has gone from 1 to 2, which costs B 5, after it announced that gain."""
    robot = robot_of(protocol, pair(), "RB", 0.0)
    started(robot)
    replies(robot, ("RA", Value((1,))))
    replies(robot, ("RA", Transfer(None)))
    replies(robot, ("RA", Gain(0, gained)))
    return list(replies(robot, ("RA", Value((2,)))))


@TRANSFERS
def test_nothing_is_handed_over_before_somebody_has_moved(protocol: type[MCSMGM]) -> None:
    robot = robot_of(protocol, pair(), "RB", 0.0)
    started(robot)
    assert replies(robot, ("RA", Value((2,)))) == [("RA", Transfer(None))]


@pytest.mark.parametrize(
    ("protocol", "gained", "entry"),
    [(MCSMGM, 4, (0, 5)), (MCSMGM, 5, None), (GCAMGM, 4, (0, 5)), (GCAMGM, 5, (0, 5))],
)
def test_who_loses_too_much_by_a_move_hands_over_its_entry(
    protocol: type[MCSMGM], gained: int, entry: tuple[int, int] | None
) -> None:
    assert moved(protocol, gained) == [("RA", Transfer(entry))]


@TRANSFERS
def test_who_is_handed_an_entry_pays_it(protocol: type[MCSMGM]) -> None:
    robot = robot_of(protocol, pair(), "RA", 0.0)
    started(robot)
    replies(robot, ("RB", Value((1,))))
    assert replies(robot, ("RB", Transfer(None))) == [("RB", Gain(0, 3))]
    assert replies(robot, ("RB", Gain(0, 0))) == [("RB", Value((2,)))]
    replies(robot, ("RB", Value((1,))))
    assert replies(robot, ("RB", Transfer((0, 5)))) == [("RB", Gain(0, 2))]


@TRANSFERS
def test_what_is_no_gain_is_refused(protocol: type[MCSMGM]) -> None:
    robot = robot_of(protocol, pair(), "RA", 0.0)
    started(robot)
    with pytest.raises(ValueError, match="RA"):
        replies(robot, ("RB", Value((1,))), ("RB", Transfer(None)), ("RB", Value((1,))))


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
