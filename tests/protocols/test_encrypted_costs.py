"""The pieces of P2-DPOP: costs that are added and compared without being read, and questions of a fixed number."""

from __future__ import annotations

import itertools
from random import Random

import numpy as np
import pytest

from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.key_stream import KeyStream
from robochoc.protocols.message import Message
from robochoc.protocols.private.ed25519 import Ed25519, PrimeGroup
from robochoc.protocols.private.elgamal import TeamKey
from robochoc.protocols.private.encrypted_costs import CostCipher, Pair
from robochoc.protocols.private.linear_order import AskAxis, Axis, CostRange, CostSum, Gone, OwnAxis, Plan, own_places
from robochoc.protocols.private.p2_dpop import P2DPOP, Bisection, EncryptedTable, Opening
from robochoc.protocols.private.rerooting import Next
from robochoc.protocols.private.ring import Ring
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.cases import looped
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of
from tests.support.pseudo_trees import unplaced
from tests.support.toy_group import ToyGroup

GROUPS = looped("group", [Ed25519, ToyGroup])


def alone(group: type[PrimeGroup] = ToyGroup) -> TeamKey:
    """A team of one robot, which can open what it encrypts."""
    key = TeamKey(group(), KeyStream(3, "R"))
    key.joint = key.share
    return key


def bit(key: TeamKey, pair: Pair) -> int:
    return int(not key.is_zero(key.stripped(pair)))


def read(cipher: CostCipher, key: TeamKey, table: bytes) -> list[float]:
    """The costs of a table."""
    found: list[float] = []
    for cell in cipher.cells(table):
        bits = [bit(key, pair) for pair in cell]
        assert bits == sorted(bits)  # what is enough stays enough
        found.append(bits.index(1) if 1 in bits else INFINITE)
    return found


# Costs


def test_costs_that_are_encrypted_are_read_again() -> None:
    key = alone()
    cipher = CostCipher(key, 5)
    costs = [0, 3, 4, INFINITE]
    assert read(cipher, key, cipher.encrypted(np.array(costs))) == costs


def test_costs_are_added_and_the_smallest_is_kept_as_in_the_open() -> None:
    key, chance = alone(), Random(2)
    for _ in range(40):
        levels, own, cells, new = (chance.randint(1, 5) for _ in range(4))

        def cost(most: int = levels) -> float:
            return INFINITE if chance.random() < 0.3 else chance.randrange(most)

        cipher = CostCipher(key, levels)
        table = [cost() for _ in range(cells)]
        added = np.array([[cost() for _ in range(new)] for _ in range(own)])
        sources = np.array([[chance.randrange(cells) for _ in range(new)] for _ in range(own)])
        fewer = cipher.eliminated(cipher.cells(cipher.encrypted(np.array(table))), sources, added)
        sums = [[table[sources[u, c]] + added[u, c] for u in range(own)] for c in range(new)]
        assert read(cipher, key, fewer) == [min(column) if min(column) < levels else INFINITE for column in sums]


def test_the_smallest_of_all_and_which_come_up_to_it() -> None:
    key = alone()
    cipher = CostCipher(key, 6)
    cells = cipher.cells(cipher.encrypted(np.array([INFINITE, 4, 2, 5, 2])))
    assert [bit(key, pair) for pair in cipher.any_of(cells)] == [0, 0, 1, 1, 1, 1]
    assert [bit(key, pair) for pair in cipher.prefixes(cells, 2)] == [0, 0, 1, 1, 1]
    assert [bit(key, pair) for pair in cipher.prefixes(cells, 4)] == [0, 1, 1, 1, 1]


@GROUPS
def test_a_sum_is_zero_only_if_all_are_and_a_blinded_one_says_no_more(group: type[PrimeGroup]) -> None:
    key = alone(group)
    zero, one = (key.pairs(key.encrypt(bit=value))[0] for value in (False, True))
    for first, second in itertools.product((zero, one), repeat=2):
        total = key.added(first, second)
        assert bit(key, total) == bit(key, key.blinded(total)) == (one in (first, second))
    double = key.added(one, one)
    opened = [key.pairs(key.stripped(pair))[0][1] for pair in (one, double, key.blinded(one), key.blinded(double))]
    assert len({*opened}) == 4
    assert opened[0] == group().one


# Questions


@looped("places", range(20))
def test_a_bisection_finds_the_first_place_and_always_asks_as_often(places: int) -> None:
    for first in range(places + 1):
        bisection, asked = Bisection(places), 0
        while bisection.left:
            assert 0 <= bisection.place < places
            bisection.receive_answer(true=bisection.place >= first)
            asked += 1
        assert bisection.found == first
        assert asked == places.bit_length()


# The own values among the declared ones


def soft(scope: str, rows: dict[tuple[int, ...], float]) -> Constraint:
    relation = Relation("R", len(scope), Semantics.SOFT, tuple(rows), tuple(rows.values()))
    return Constraint("c", relation, tuple(scope), tuple(scope))


def pair_of() -> Team:
    """B cannot take 2, and pays for 3."""
    constraints = [soft("AB", {(1, 1): 5}), soft("B", {(2,): INFINITE, (3,): 1})]
    return with_costs(team_of({"A": (1, 2), "B": (1, 2, 3)}, constraints))


def test_declared_values_are_those_of_the_files_whatever_is_private() -> None:
    for parameters, withdrawal in ((RunParameters(), []), (RunParameters(withdrawal_cost=9), [(None,)])):
        problem = LocalProblem(agent_problems(pair_of(), parameters, shared_scopes=True)["RB"])
        assert problem.declared("RB") == [(1,), (2,), (3,), *withdrawal]
        assert problem.declared("RA") == [(1,), (2,), *withdrawal]
        assert problem.declared_count("RB") == len(problem.declared("RB"))
        places = own_places(problem)
        assert {place: problem.values[index] for place, index in places.items()} == {
            place: value for place, value in enumerate(problem.declared("RB")) if place != 1
        }
        axis = OwnAxis("x", list(reversed(range(len(problem.declared("RB"))))))
        assert {axis.order[code] for code in axis.codes(places)} == {*places}


# What cannot be


def robot(name: str = "RB") -> P2DPOP:
    """A robot of a pair that has taken its place in the tree, under RA, and has heard what a turn needs."""
    one = unplaced(P2DPOP, pair_of(), name)
    one.secret = KeyStream(0, name)
    one.parent = "RA"
    one.placed = True
    one.join_ring(Ring("RA", ()))
    one.costs = CostRange(0, 6)
    one.turns = 2
    return one


CODENAME = "0" * 32


@looped(("message", "why"), [
    (CostRange(0, 1), "unexpected or invalid CostRange"), (CostSum(0, 1), "second time"),
    (Plan(1, {}), "received an unexpected"), (Plan(0, {CODENAME: 0}), "invalid plan"),
    (Plan(0, dict.fromkeys(map(str, range(1_001)), 2)), "invalid plan"),
    (AskAxis(2), "unexpected AskAxis"), (AskAxis(-1), "unexpected AskAxis"), (Gone(0), "without a request"),
    (Axis(0, CODENAME, [(1,), (2,)]), "without a request"), (EncryptedTable(0, b""), "received an unexpected"),
    (Opening(b"x"), "it must have 64"), (Opening(b"\xff" * 64), "not an element"),
])  # fmt: skip
def test_a_message_that_cannot_be_is_refused(message: Message, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        robot().receive("RA", message)


@looped(("answer", "why"), [
    (Axis(0, "short", [(1,), (2,)]), "values, or an invalid codename"),
    (Axis(0, CODENAME, [(1,)]), "values, or an invalid codename"),
    (Axis(0, CODENAME, [(1,), (1,)]), "other values than the declared"),
    (Axis(0, CODENAME, [(1,), (None,)]), "other values than the declared"),
    (Axis(1, CODENAME, [(1,), (2,)]), "not of turn 0"),
])  # fmt: skip
def test_an_axis_that_cannot_be_is_refused(answer: Axis, why: str) -> None:
    one = robot()
    one.receive("RA", Plan(0, {CODENAME: 2}))
    with pytest.raises(ValueError, match=why):
        one.receive("RA", answer)


def test_an_axis_of_another_size_than_the_table_s_is_refused() -> None:
    one = robot()
    one.receive("RA", Plan(0, {CODENAME: 3}))
    with pytest.raises(ValueError, match="a different number in the table"):
        one.receive("RA", Axis(0, CODENAME, [(1,), (2,)]))


def test_the_own_axis_of_another_size_is_refused() -> None:
    one = robot()
    with pytest.raises(ValueError, match="invalid plan"):
        one.receive("RA", Plan(0, {one.own_axis(0).codename: 2}))


def test_a_table_of_another_size_than_planned_and_one_of_no_elements_are_refused() -> None:
    one = robot()
    one.receive("RA", Plan(0, {CODENAME: 2}))
    one.receive("RA", Axis(0, CODENAME, [(2,), (1,)]))
    one.receive("RA", Next())
    one.receive("RA", Next())
    size = 2 * 7 * 64
    for wrong in (b"", bytes(size - 1), bytes(size + 64)):
        with pytest.raises(ValueError, match="a size other than planned"):
            one.receive("RA", EncryptedTable(0, wrong))
    with pytest.raises(ValueError, match="not an element"):
        one.receive("RA", EncryptedTable(0, b"\xff" * size))


def test_nobody_else_ends_a_turn_and_nobody_the_last() -> None:
    one = robot()
    with pytest.raises(ValueError, match="RB sent an unexpected Next"):
        one.receive("RB", Next())
    for _ in range(3):
        one.receive("RA", Next())
    with pytest.raises(ValueError, match="RA sent an unexpected Next"):
        one.receive("RA", Next())
