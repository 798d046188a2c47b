"""What DPOP refuses: tables that do not fit, costs that are not exact, and what no robot says."""

from __future__ import annotations

import errno
import math
import os
import re
import tracemalloc
from pathlib import Path

import msgspec
import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import AnyEvent, Given, Sent
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics
from robochoc.protocols.inference import dpop_tables
from robochoc.protocols.inference.dpop import DPOP, UTIL, VALUE, Dimensions, Need, Proceed
from robochoc.protocols.inference.dpop_tables import Extent, Result, bytes_of
from robochoc.protocols.message import Message, encode
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.solver.exact_costs import EXACT
from tests.support.agents import replies
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import with_costs
from tests.support.dpop_robots import PRODUCT, begun, dimensions, domain, leaf, products
from tests.support.problems import ON_ONE_MACHINE, team_of


def test_over_the_limit_the_root_says_who_needs_how_much_before_any_table_is_made() -> None:
    robot = begun(products("ABC", "AB BC AC"), "RA", below="B", further="C")
    says = (
        "RC needs 50,000,000,000 bytes for its tables, more than 1,073,741,824 in memory and 4,294,967,296 on the disk:"
        " the robots' pseudo-tree has induced width 7 (--set memory=BYTES and --set disk=BYTES raise the limits)"
    )
    with pytest.raises(TooLargeError, match=re.escape(says)):
        replies(robot, ("RB", dimensions({"RA": 3}, width=7, most=Need(50_000_000_000, "RC"))))
    assert robot.problem.checks == 0


def test_a_need_above_the_free_space_of_the_disk_is_refused_before_any_table_is_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("robochoc.protocols.inference.dpop.free_disk_bytes", lambda: 1_999_999_999)
    robot = begun(products("ABC", "AB BC AC"), "RA", below="B", further="C")
    with pytest.raises(TooLargeError, match=r"RC needs 2,000,000,000 bytes .* only 1,999,999,999 bytes left .*TMPDIR"):
        replies(robot, ("RB", dimensions({"RA": 3}, width=7, most=Need(2_000_000_000, "RC"))))
    assert robot.problem.checks == 0


@looped("protocol", ["dpop", "s-dpop", "mb-dpop", "rmb-dpop"])
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 100), marks=pytest.mark.more)], ids=str)
def test_tables_on_the_disk_make_no_difference(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, protocol: str, seeds: range
) -> None:
    """Neither to messages nor to the optimum, and the folder stays empty."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(dpop_tables, "BLOCK", 40)
    monkeypatch.setattr(dpop_tables, "SMALL", 9)
    monkeypatch.setattr(dpop_tables, "RESIDENT", 100)
    monkeypatch.setattr(dpop_tables, "PIECE", 50)
    for seed in seeds:
        team = random_csp(8, 3, 0.7, 0.1, seed, max_cost=99)
        found = []
        for memory in ("1", str(2**30)):
            events: list[AnyEvent] = []
            settings = {"memory": memory, "disk": str(2**30)}
            if protocol.endswith("mb-dpop"):
                settings["k"] = str(3 + seed % 3)
            outcome = solve(
                team,
                Options(protocol=protocol, runtime=Runtime.SIMULATOR, settings=settings),
                observer=events.append,
            )
            metrics = outcome.metrics
            said = [event for event in events if not isinstance(event, Given)]  # it contains the settings
            found.append((outcome.cost, outcome.verdict, metrics.messages, metrics.bytes, said))
            assert not [*tmp_path.iterdir()]
        assert found[0] == found[1]
        least = least_cost(team)
        assert found[0][0] == (None if least == INFINITE else least)


def test_a_table_on_the_disk_is_sent_between_processes() -> None:
    team = random_csp(8, 3, 0.7, 0.1, 0, max_cost=99)
    found = []
    for memory in ("1", str(2**30)):
        events: list[AnyEvent] = []
        outcome = solve(team, Options(protocol="dpop", settings={"memory": memory}), observer=events.append)
        assert any(isinstance(event, Sent) and event.type == "UTIL" for event in events)
        found.append(outcome.cost)
    assert found[0] == found[1]


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="the space of a file cannot be reserved")
def test_a_full_disk_ends_the_run_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full)
    with pytest.raises(UnsupportedError, match=r"a table of \d+ bytes cannot be stored .*No space left.*TMPDIR"):
        solve(
            products("ABCD", "AB BC CD AC BD"),
            Options(protocol="dpop", runtime=Runtime.SIMULATOR, settings={"memory": "1"}),
        )


def test_a_robot_s_arrays_never_take_more_than_it_has_told() -> None:
    """And what its children have told it goes as soon as it is not needed any more."""
    names, size = "ABCDE", 20
    team = products(names, "AD BD CD DE", range(size))
    robot = begun(team, "RD", "CBA", "E")
    robot.problem.tables({f"R{name}": domain(range(size)).values for name in "ABC"})  # prices are remembered
    ((_, said),) = replies(
        robot,
        *((f"R{name}", domain(range(size))) for name in "ABC"),
        ("RE", dimensions({f"R{name}": size for name in "DCBA"}, dearest=200)),
    )
    assert isinstance(said, Dimensions)
    table = UTIL(1, bytes(size**4))
    tracemalloc.start()
    try:
        replies(robot, ("RC", Proceed(["RC", "RB", "RA"])))
        ((_, sent),) = replies(robot, ("RE", table))
        left, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert sent == UTIL(1, bytes(size**3))
    assert said.most.bytes > size**4
    assert peak < said.most.bytes + 50_000
    assert left < 2 * size**3 + 30_000


def test_a_robot_needs_room_for_the_tables_of_its_constraints_and_of_its_children() -> None:
    robot = begun(products("ABCD", "AC BC CD", (1, 2, 3)), "RC", "BA", "D")
    heard = [("RB", domain()), ("RA", domain()), ("RD", dimensions({"RC": 3, "RA": 3}, dearest=300))]
    ((_, said),) = replies(robot, *heard)
    assert isinstance(said, Dimensions)
    floats, child = Extent(3 * 3, 8), Extent(3 * 3, 2)
    assert said.most == Need(bytes_of([Result([3, 3], 3, 2)], [floats, floats, child]), "RC")


def test_sizes_do_not_overflow() -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    with pytest.raises(TooLargeError, match=r"RA needs more than 10\^308 bytes"):
        replies(robot, ("RB", dimensions({f"R{number}": 10**9 for number in range(99)})))
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    sizes = {f"R{number}": 10**9 for number in range(9)}
    ((_, said),) = replies(robot, ("RA", domain()), ("RC", dimensions({"RB": 3, **sizes})))
    assert isinstance(said, Dimensions)
    assert said.most.bytes == pytest.approx(3e81 * 3)  # a byte for a cell's cost, one for the choice, one on its way
    assert msgspec.msgpack.decode(encode(said), type=Dimensions) == said


def test_costs_that_may_not_be_exact_end_the_run() -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    with pytest.raises(TooLargeError, match=r"costs may add up to 2\^53 or more"):
        replies(robot, ("RB", dimensions({"RA": 3}, dearest=EXACT)))


@looped("factor", [1, 60, 5000, 10**8, 10**14])
def test_costs_are_exact_up_to_there(factor: int) -> None:
    """With one, two, four and eight bytes a cost."""
    costs = tuple((cost + 1) * factor + cost for cost in PRODUCT.costs)
    dear = Relation("R", 2, Semantics.SOFT, PRODUCT.tuples, costs, 0)
    pairs = ("AB", "BC", "AC")
    constraints = [Constraint("C", dear, tuple(pair), tuple(pair)) for pair in pairs]
    team = with_costs(team_of(dict.fromkeys("ABC", (2, 3)), constraints))
    assert solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)).cost == 3 * (5 * factor + 4)


@looped("withdraw", [None, Withdrawal.MINIMUM])
def test_a_run_over_the_limit_says_the_same_in_every_runtime(withdraw: Withdrawal | None) -> None:
    team = products("ABCDE", "AB BC AC AD BD CD AE")
    said = []
    for runtime in ON_ONE_MACHINE:
        options = Options(protocol="dpop", runtime=runtime, settings={"memory": "100", "disk": "0"}, withdraw=withdraw)
        with pytest.raises(UnsupportedError) as refused:
            solve(team, options)
        said.append(str(refused.value))
    assert said[0] == said[1]
    assert re.match(
        r"R[CD] needs [\d,]+ bytes for its tables, more than 100 in memory and 0 on the disk: .* induced width 3 ",
        said[0],
    )
    assert "dpop" not in re.split(r"[ ,]+", said[0])


@looped("memory", ["0", "-1", "much"])
def test_what_is_no_number_of_bytes_is_refused(memory: str) -> None:
    with pytest.raises(UnsupportedError, match=r"--set: .*memory"):
        solve(products("AB", "AB"), Options(protocol="dpop", settings={"memory": memory}))


# What is no message of a well-behaved robot


def test_a_table_that_was_not_asked_for_is_refused() -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    replies(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})))
    with pytest.raises(ValueError, match="RC sent a table without a request"):
        replies(robot, ("RC", UTIL(1, bytes(3))))


@looped("costs", [b"", bytes(4), bytes([10, 0, 0])])
def test_a_table_of_another_size_or_costs_above_the_bound_is_refused(costs: bytes) -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    replies(robot, ("RB", dimensions({"RA": 3})))
    with pytest.raises(ValueError, match=r"do not fit|above the announced maximum"):
        replies(robot, ("RB", UTIL(1, costs)))


def test_children_that_contradict_each_other_are_refused() -> None:
    robot = begun(products("ABCD", "AB BC BD"), "RB", "A", "CD")
    with pytest.raises(ValueError, match="RC sent a wrong domain size: 4 values of RA"):
        replies(robot, ("RA", domain()), ("RC", dimensions({"RA": 4})), ("RD", dimensions({"RA": 3})))


@looped(("sender", "message"), [("RC", dimensions({"RB": 9})), ("RA", dimensions({})), ("RC", domain())])
def test_who_speaks_twice_or_out_of_place_is_refused(sender: str, message: Message) -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    replies(robot, ("RC", dimensions({"RB": 3})))
    with pytest.raises(ValueError, match=f"{sender} sent an unexpected or repeated message"):
        replies(robot, (sender, message))


def test_who_has_no_room_does_not_proceed() -> None:
    """Though a root should never let it."""
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    replies(robot, ("RA", domain()), ("RC", dimensions({"RB": 3, **{f"R{number}": 10**9 for number in range(9)}})))
    with pytest.raises(ValueError, match="exceed the limit of memory"):
        replies(robot, ("RA", Proceed(["RA", *(f"R{number}" for number in range(9))])))


@looped("said", [
    dimensions({f"R{number}": 2 for number in range(10_000)}),
    dimensions({"RA": 3}, width=-5), dimensions({"RA": 3}, most=Need(math.nan, "RC")),
    dimensions({"RA": 3}, most=Need(-1, "RC")),
])  # fmt: skip
def test_dimensions_that_cannot_be_are_refused(said: Dimensions) -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    with pytest.raises(ValueError, match="sent invalid dimensions"):
        replies(robot, ("RC", said))


def test_axes_that_are_not_the_separator_s_are_refused() -> None:
    with pytest.raises(ValueError, match="its separator is RA, RB"):
        replies(leaf(products("ABC", "AB BC AC")), ("RB", Proceed(["RB"])))


@looped("assignment", [[], [0], [0, 3], [-1, 0]])
def test_values_that_are_none_are_refused(assignment: list[int]) -> None:
    robot = leaf(products("ABC", "AB BC AC"))
    replies(robot, ("RB", Proceed(["RB", "RA"])))
    with pytest.raises(ValueError, match="are not values of RB, RA"):
        replies(robot, ("RB", VALUE(assignment)))


def test_a_value_that_comes_twice_is_refused() -> None:
    robot = leaf(products("ABC", "AB BC AC"))
    replies(robot, ("RB", Proceed(["RB", "RA"])), ("RB", VALUE([0, 0])))
    with pytest.raises(ValueError, match="RC already has a value"):
        replies(robot, ("RB", VALUE([0, 0])))


def test_the_limit_is_the_robots_too() -> None:
    """As the run's settings reach them."""
    with pytest.raises(TooLargeError):
        Simulation(
            products("AB", "AB"),
            DPOP,
            RandomChannels(0),
            parameters=RunParameters(settings={"memory": "9", "disk": "0"}),
        ).run()
