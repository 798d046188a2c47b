"""SFB without costs: its bits say what the numbers of `sfb_bounds` say."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats import PREDEFINED
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Team
from robochoc.protocols.optimization.run_lengths import RunLengths
from robochoc.protocols.optimization.sfb import SFB
from robochoc.protocols.optimization.sfb_bits import ForwardBits
from robochoc.protocols.optimization.sfb_bounds import VALUES, ForwardBounds
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.examples import count
from tests.support.problems import random_team, team_of
from tests.support.sfb_robots import grouped
from tests.support.solver_networks import compiled_by_brute_force


def both(team: Team) -> list[tuple[ForwardBits, ForwardBounds]]:
    """Of each robot the bits and the numbers, once the ceiling is known."""
    parts = agent_problems(compiled_by_brute_force(team), shared_scopes=True)
    order = PriorityOrder(team.order)
    domains = [LocalProblem(parts[name]).values for name in order.names]
    known = RunLengths(*grouped(domains))
    if not all(domains):
        return []
    made = []
    for name in order.names:
        first, second = LocalProblem(parts[name]), LocalProblem(parts[name])
        bits, numbers = ForwardBits(first, order, known), ForwardBounds(second, order, known)
        assert first.checks == second.checks
        bits.count_up_to(1)
        numbers.count_up_to(1)
        made.append((bits, numbers))
    return made


def spelt(bits: list[tuple[bytes, int]], sizes: list[int], above: int) -> list[list[int]]:
    """Rows of bits as the numbers that they stand for: places, and 0 or 1 for each value."""
    rows = []
    for chosen, fields in bits:
        width = len(chosen) // above if above else 1
        row = [int.from_bytes(chosen[at : at + width], "little") for at in range(0, len(chosen), width)]
        start = 0
        for size in sizes:
            row += [1 - (fields >> start + place & 1) for place in range(size)]
            start += size + 1
        rows.append(row)
    return rows


@count("teams", 60, 6000)
def test_rows_are_the_same_in_the_same_order(teams: int) -> None:
    chance = Random("bits")
    compared = 0
    for _ in range(teams):
        made = both(chance.choice((random_team, random_complex_team))(chance))
        if not made:
            continue
        sizes = [len(bits._left) for bits, _ in made]  # noqa: SLF001 - the number of own values
        charges = [[0.0] * size for size in sizes]
        bits, numbers = made[0][0].nothing(charges), made[0][1].nothing(charges)
        for rank, (small, large) in enumerate(made[:-1]):
            bits, numbers = small.extended(bits, 1), large.extended(numbers, 1)
            assert spelt(bits, sizes[rank + 1 :], rank + 1) == numbers[:, VALUES:].tolist()
            assert not numbers[:, :VALUES].any(), "costs and bounds are 0"
            assert len(small.packed(bits)) == len(bits) * small.width
            compared += len(bits)
            if not bits:
                break
            packed = small.packed(bits)
            assert made[rank + 1][0].read(packed, len(bits)) == bits
        else:
            assert made[-1][0].completed(bits) == made[-1][1].completed(numbers)
    assert compared > 4 * teams


@count("teams", 12, 1200)
def test_answers_are_those_of_brute_force_however_little_memory_there_is(teams: int) -> None:
    chance = Random("few bits")
    for seed in range(teams):
        team = random_team(chance)
        choices = {"window": (1, 2, 3), "memory": (1, 40, 2000), "batch": (1, 3, 4096)}
        settings = {name: str(chance.choice(several)) for name, several in choices.items()}
        result = Simulation(team, SFB, RandomChannels(seed), parameters=RunParameters(settings=settings)).run(60)
        truth = Verdict.SOLUTION if any(solutions(team)) else Verdict.NO_SOLUTION
        assert result.verdict is truth, (seed, settings)


def test_a_row_takes_a_bit_for_each_value_and_one_for_each_robot() -> None:
    seen: list[object] = []
    Simulation(random_csp(9, 7, 0.3, 0.2, seed=1), SFB, RandomChannels(0), observer=seen.append).run()
    sent = [event for event in seen if isinstance(event, Sent)]
    rows = [event.content for event in sent if event.type == "CPAs" and event.sender == "Robot1"]
    assert {len(one["rows"]) // one["count"] for one in rows} == {1 + 8 * (7 + 1) // 8}


@looped(("values", "size"), [(256, 1), (257, 2)])
def test_places_of_many_values_take_two_bytes(values: int, size: int) -> None:
    less = (Constraint(pair, PREDEFINED["le"], tuple(pair), tuple(pair)) for pair in ("AB", "AC", "BC"))
    (first, _), (second, _), _ = both(team_of({"A": range(values), "B": range(values), "C": (values - 1,)}, less))
    rows = first.extended(first.nothing([[0.0] * values]), 1)
    assert len(rows) == values
    assert {len(chosen) for chosen, _ in rows} == {size}
    assert second.read(first.packed(rows), values) == rows


def test_places_that_there_are_not_are_refused_in_two_bytes_as_well() -> None:
    less = Constraint("L", PREDEFINED["le"], ("A", "B"), ("A", "B"))
    (first, _), (second, _) = both(team_of({"A": range(300), "B": range(300)}, [less]))
    row = first.packed(first.extended(first.nothing([[0.0] * 300]), 1)[:1])
    assert second.read((299).to_bytes(2, "little") + row[2:], 1)
    with pytest.raises(ValueError, match="values that do not exist"):
        second.read((300).to_bytes(2, "little") + row[2:], 1)


@looped(
    ("rows", "number", "ceiling"),
    [
        (b"", 1, 1),
        (b"", 0, 1),
        (b"\x00\x77", 2, 1),
        (b"\x03\x77", 1, 1),  # there are three values
        (b"\x00\x7f", 1, 1),  # a guard bit
        (b"\x00\x77", 1, 2),  # costs
    ],
)
def test_what_is_no_row_is_refused(rows: bytes, number: int, ceiling: int) -> None:
    bits = both(random_csp(3, 3, 1, 0.2, seed=3))[1][0]
    assert bits.read(b"\x02\x77", 1) == [(b"\x02", 0x77)]

    def told() -> None:
        bits.count_up_to(ceiling)
        bits.read(rows, number)

    with pytest.raises(ValueError, match=r"costs of up to|partial assignment"):
        told()


def test_nothing_is_left_once_there_is_a_solution() -> None:
    bits = both(random_csp(3, 3, 1, 0.2, seed=3))[1][0]
    rows = bits.read(b"\x02\x77", 1)
    assert bits.below(rows, 1) == rows
    assert bits.below(rows, 0) == bits.extended(rows, 0) == []
    assert bits.completed([]) == (1, [])


@looped(("n", "checks", "ncccs"), [(3, 252, 54), (4, 1216, 144)])
def test_robots_evaluate_their_constraints_at_the_same_time(n: int, checks: int, ncccs: int) -> None:
    spent = Simulation(queens3d(n), SFB, RandomChannels(0)).run(60).metrics
    assert (spent.checks, spent.ncccs) == (checks, ncccs)


@count("teams", 20, 1000)
def test_what_was_looked_at_before_is_not_evaluated_again(teams: int) -> None:
    chance = Random("ahead")
    for _ in range(teams):
        team = chance.choice((random_team, random_complex_team))(chance)
        parts = agent_problems(compiled_by_brute_force(team), shared_scopes=True)
        domains = {name: LocalProblem(part).values for name, part in parts.items()}
        for place, name in enumerate(team.order):
            above = {other: domains[other] for other in team.order[:place]}
            robot, other_robot = LocalProblem(parts[name]), LocalProblem(parts[name])
            robot.look_ahead()
            looked_at = robot.checks
            for lowest in team.order[place + 1 :]:
                known = {**above, lowest: domains[lowest]}
                assert robot.allowed(known, lowest) == other_robot.allowed(known, lowest)
            assert other_robot.checks <= robot.checks == looked_at
