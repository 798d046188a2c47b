"""One test per rule of DPOP (Petcu and Faltings, IJCAI 2005, Algorithm 1), named for it."""

from __future__ import annotations

import doctest
import itertools
import math
import re
import tracemalloc
from collections.abc import Iterable, Sequence

import msgspec
import pytest
from agents import told, value
from cost_problems import with_costs
from problems import team_of

import robochoc.protocols.dpop
from robochoc.communication.schedule import RandomChannels
from robochoc.communication.simulator import Simulation
from robochoc.expression import Type, parse
from robochoc.message import Message, encode
from robochoc.outcome import Verdict
from robochoc.problem import INFINITE, Constraint, Predicate, Relation, Semantics, Team
from robochoc.protocols.dpop import DPOP, UTIL, VALUE, Dimensions, Domain, Need, Proceed
from robochoc.protocols.dpop_tables import EXACT
from robochoc.protocols.order import PriorityOrder
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.solver.compiled import LocalProblem
from robochoc.solver.encoding import TooMuch, Unsupported
from robochoc.solver.part import Brief, parts

PRODUCT = Relation("R", 2, Semantics.SOFT, tuple(itertools.product((1, 2, 3), repeat=2)), (1, 2, 3, 2, 4, 6, 3, 6, 9))
"""Two values cost their product."""
FEW = Need(1, "RX")


def products(names: str, pairs: str, values: Sequence[int] = (1, 2, 3)) -> Team:
    """A robot for each letter; each of `pairs` pays the product of its values."""
    constraints = [Constraint("C", PRODUCT, (pair[0], pair[1]), (pair[0], pair[1])) for pair in pairs.split()]
    return with_costs(team_of(dict.fromkeys(names, values), constraints))


def placed(team: Team, name: str, above: str = "", below: str = "", further: str = "") -> DPOP:
    """One robot that has its place: below the first letter of `above`, with children `below` and pseudo-children."""
    robot = DPOP(LocalProblem(parts(team, everywhere=True)[name]), PriorityOrder(team.order))
    robot.parent = f"R{above[0]}" if above else None
    robot.pseudo_parents = tuple(f"R{letter}" for letter in above[1:])
    robot.children = tuple(f"R{letter}" for letter in below)
    robot.pseudo_children = tuple(f"R{letter}" for letter in further)
    robot.placed = True
    return robot


def begun(team: Team, name: str, above: str = "", below: str = "", further: str = "") -> DPOP:
    """The same, with nothing left to say."""
    robot = placed(team, name, above, below, further)
    robot.begin()
    robot.outbox.clear()
    return robot


def domain(values: Iterable[int] = (1, 2, 3)) -> Domain:
    return Domain([(value,) for value in values])


def dimensions(sizes: dict[str, int], dearest: int = 9, width: int = 1, most: Need = FEW) -> Dimensions:
    return Dimensions(sizes, dearest, width, most)


def kinds(said: Sequence[tuple[str, Message]]) -> list[tuple[str, str]]:
    return [(receiver, type(message).__name__) for receiver, message in said]


def leaf(team: Team, name: str = "RC") -> DPOP:
    """The lowest of three, which has told its separator."""
    robot = begun(team, name, "BA")
    told(robot, ("RB", domain()), ("RA", domain()))
    return robot


def test_those_below_are_told_the_own_values() -> None:
    robot = placed(products("ABC", "AB BC AC"), "RA", below="B", further="C")
    robot.begin()
    assert robot.outbox == [("RB", domain()), ("RC", domain())]


def test_a_leaf_tells_its_separator_once_all_above_have_told_their_values() -> None:
    robot = begun(products("ABC", "AB BC AC"), "RC", "BA")
    assert told(robot, ("RB", domain())) == []
    ((receiver, said),) = told(robot, ("RA", domain()))
    assert receiver == "RB"
    assert isinstance(said, Dimensions)
    assert (said.separator, said.dearest, said.induced_width, said.most.robot) == ({"RA": 3, "RB": 3}, 18, 2, "RC")


def test_a_separator_is_the_children_s_and_the_own_robots_above_without_the_robot_itself() -> None:
    robot = begun(products("ABCD", "AB BC CD AD"), "RC", "B", "D")
    ((_, said),) = told(robot, ("RB", domain()), ("RD", dimensions({"RC": 3, "RA": 3}, 5, 2, Need(1 << 40, "RD"))))
    assert said == Dimensions({"RB": 3, "RA": 3}, 14, 2, Need(1 << 40, "RD"))


def test_a_neighbour_above_without_a_constraint_takes_no_axis() -> None:
    """RC's constraint with RA and RB is checked below: by RD, which is in it too."""
    quarrel = Relation("R", 4, Semantics.SOFT, ((1, 1, 1, 1),), (5,), 0)
    scope = ("A", "B", "C", "D")
    team = with_costs(team_of(dict.fromkeys("ABCD", (1, 2)), [Constraint("C", quarrel, scope, scope)]))
    robot = begun(team, "RC", "BA", "D")
    ((_, said),) = told(robot, ("RB", domain((1, 2))), ("RA", domain((1, 2))), ("RD", dimensions({"RC": 2, "RA": 2})))
    assert isinstance(said, Dimensions)
    assert said.separator == {"RA": 2}


def test_a_robot_with_one_value_takes_no_axis() -> None:
    team = with_costs(
        team_of({"A": (1, 2), "B": (3,), "C": (2, 3)}, [*products("ABC", "AC BC").constraints()]),
    )
    robot = begun(team, "RC", "BA")
    told(robot, ("RB", domain((3,))), ("RA", domain((1, 2))))
    assert [said.costs for _, said in told(robot, ("RB", Proceed(["RA"]))) if isinstance(said, UTIL)] == [
        bytes([8, 10])
    ]
    told(robot, ("RB", VALUE([1])))
    assert value(robot) == (2,)


def test_a_pseudo_tree_may_be_wider_than_arrays_can_be_if_robots_have_one_value() -> None:
    names = [f"X{number:02}" for number in range(80)]
    free = Predicate("free", ("X", "Y"), parse("ne(X, Y)", ("X", "Y"), Type.BOOLEAN))
    pairs = itertools.combinations(names, 2)
    constraints = [Constraint("C", free, pair, pair, cost=1) for pair in pairs]
    team = with_costs(team_of({name: (1,) if name < "X77" else (1, 2, 3) for name in names}, constraints))
    outcome = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert outcome.verdict is Verdict.OPTIMAL
    assert outcome.cost == 77 * 76 // 2 + 1


def test_the_root_lets_all_proceed_once_all_fits() -> None:
    robot = begun(products("ABC", "AB BC AC"), "RA", below="B", further="C")
    said = told(robot, ("RB", dimensions({"RA": 3})))
    assert said[-1] == ("RB", Proceed(["RA"]))


def test_axes_are_told_down_the_nearest_robot_first() -> None:
    team = products("ABCD", "AB BC CD AD BD")
    robot = begun(team, "RC", "B", "D")
    told(robot, ("RB", domain()), ("RD", dimensions({"RA": 3, "RB": 3, "RC": 3})))
    assert told(robot, ("RB", Proceed(["RB", "RA"]))) == [("RD", Proceed(["RC", "RB", "RA"]))]


def test_no_constraint_is_checked_before_all_may_proceed() -> None:
    robot = leaf(products("ABC", "AB BC AC"))
    assert robot.problem.checks == 0
    told(robot, ("RB", Proceed(["RB", "RA"])))
    assert robot.problem.checks == 2 * 3 * 3


def test_a_leaf_computes_and_sends_its_table() -> None:
    """For each combination of values above, what the cheapest own value costs."""
    robot = leaf(products("ABC", "AB BC AC"))
    assert told(robot, ("RB", Proceed(["RB", "RA"]))) == [("RB", UTIL(1, bytes([2, 3, 4, 3, 4, 5, 4, 5, 6])))]


def test_a_table_waits_for_all_children_and_adds_up_what_they_say() -> None:
    robot = begun(products("ABCD", "AB BC BD"), "RB", "A", "CD")
    told(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})), ("RD", dimensions({"RB": 3})))
    told(robot, ("RA", Proceed(["RA"])))
    assert told(robot, ("RC", UTIL(1, bytes([9, 5, 1])))) == []
    # A's value times 1, 2, 3, and what C and D say of these.
    assert told(robot, ("RD", UTIL(1, bytes([9, 0, 1])))) == [("RA", UTIL(1, bytes([5, 8, 11])))]


def test_a_table_may_come_in_pieces() -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    told(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})))
    told(robot, ("RA", Proceed(["RA"])), ("RC", UTIL(1, bytes([9, 5]))))
    assert kinds(told(robot, ("RC", UTIL(1, bytes([1]))))) == [("RA", "UTIL")]


def test_the_root_chooses_what_is_cheapest_and_knows_the_bound() -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    told(robot, ("RB", dimensions({"RA": 3})))
    assert robot.findings.bound is None
    assert told(robot, ("RB", UTIL(1, bytes([7, 4, 4])))) == [("RB", VALUE([1]))]
    assert value(robot) == (2,)
    assert robot.findings.bound == 4


def test_a_value_message_lets_a_robot_choose_and_tell_its_children() -> None:
    robot = begun(products("ABCD", "AB BC CD AD"), "RC", "B", "D")
    told(robot, ("RB", domain()), ("RD", dimensions({"RC": 3, "RA": 3})))
    told(robot, ("RB", Proceed(["RB", "RA"])), ("RD", UTIL(1, bytes([9, 9, 9, 9, 9, 0, 9, 9, 9]))))
    assert value(robot) is None
    assert told(robot, ("RB", VALUE([0, 2]))) == [("RD", VALUE([1, 2]))]
    assert value(robot) == (2,)


def test_of_equal_values_the_first_is_taken() -> None:
    assert solve(products("AB", ""), Options(protocol="dpop", runtime=Runtime.SIMULATOR)).assignment == {"A": 1, "B": 1}


def test_a_table_of_broken_constraints_ends_the_search() -> None:
    never = Relation("R", 2, Semantics.SUPPORTS, ())
    team = with_costs(team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", never, ("A", "B"), ("A", "B"))]))
    robot = begun(team, "RB", "A")
    told(robot, ("RA", domain((1, 2))))
    assert told(robot, ("RA", Proceed(["RA"]))) == []
    assert robot.verdict is Verdict.NO_SOLUTION
    assert told(robot, ("RA", VALUE([0]))) == []


def test_a_robot_alone_takes_its_cheapest_value() -> None:
    charge = Relation("R", 1, Semantics.SOFT, ((1,), (2,), (3,)), (3, 1, INFINITE), 0)
    team = with_costs(team_of({"A": (1, 2, 3)}, [Constraint("C", charge, ("A",), ("A",))]))
    result = Simulation(team, DPOP, RandomChannels(0)).run()
    assert result.assignments == {"RA": {"A": 2}}
    assert result.findings["RA"].bound == 1
    assert result.metrics.messages == {}


def test_trees_have_nothing_to_do_with_each_other() -> None:
    result = Simulation(products("ABCDE", "AB CD DE", (2, 3)), DPOP, RandomChannels(1)).run()
    assert sum(found.bound or 0 for found in result.findings.values()) == 3 * 4


def test_messages_are_as_many_as_the_tree_says() -> None:
    team = products("ABCDEF", "AB AC BD BE CF AD")
    sent = Simulation(team, DPOP, RandomChannels(2)).run().metrics.messages
    wanted = {"Domain": 6, "Dimensions": 5, "Proceed": 5, "UTIL": 5, "VALUE": 5}
    assert {name: sent[name] for name in wanted} == wanted


# The limits


def test_over_the_limit_the_root_says_who_needs_how_much_before_any_table_is_made() -> None:
    robot = begun(products("ABC", "AB BC AC"), "RA", below="B", further="C")
    says = "RC needs 5,000,000,000 bytes for its tables, more than 1,073,741,824: the robots' pseudo-tree has induced"
    with pytest.raises(TooMuch, match=re.escape(f"{says} width 7 (--set memory=BYTES raises the limit)")):
        told(robot, ("RB", dimensions({"RA": 3}, width=7, most=Need(5_000_000_000, "RC"))))
    assert robot.problem.checks == 0


def test_a_robot_s_arrays_never_take_more_than_it_has_told() -> None:
    """And what its children have told it goes as soon as it is not needed any more."""
    names, size = "ABCDE", 20
    team = products(names, "AD BD CD DE", range(size))
    robot = begun(team, "RD", "CBA", "E")
    robot.problem.tables({f"R{name}": domain(range(size)).values for name in "ABC"})  # prices are remembered
    ((_, said),) = told(
        robot,
        *((f"R{name}", domain(range(size))) for name in "ABC"),
        ("RE", dimensions({f"R{name}": size for name in "DCBA"}, dearest=200)),
    )
    assert isinstance(said, Dimensions)
    table = UTIL(1, bytes(size**4))
    tracemalloc.start()
    try:
        told(robot, ("RC", Proceed(["RC", "RB", "RA"])))
        ((_, sent),) = told(robot, ("RE", table))
        left, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert sent == UTIL(1, bytes(size**3))
    assert said.most.bytes > size**4
    assert peak < said.most.bytes + 50_000
    assert left < 2 * size**3 + 30_000


def test_sizes_do_not_overflow() -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    with pytest.raises(TooMuch, match=r"RA needs more than 10\^308 bytes"):
        told(robot, ("RB", dimensions({f"R{number}": 10**9 for number in range(99)})))
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    sizes = {f"R{number}": 10**9 for number in range(9)}
    ((_, said),) = told(robot, ("RA", domain()), ("RC", dimensions({"RB": 3, **sizes})))
    assert isinstance(said, Dimensions)
    assert said.most.bytes == pytest.approx(3e81 * 3)  # a byte for a cell's cost, one for the choice, one on its way
    assert msgspec.msgpack.decode(encode(said), type=Dimensions) == said


def test_costs_that_may_not_be_exact_end_the_run() -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    with pytest.raises(TooMuch, match=r"costs could add up to 2\^53 or more"):
        told(robot, ("RB", dimensions({"RA": 3}, dearest=EXACT)))


@pytest.mark.parametrize("factor", [1, 60, 5000, 10**8, 10**14])
def test_costs_are_exact_up_to_there(factor: int) -> None:
    """With one, two, four and eight bytes a cost."""
    costs = tuple((cost + 1) * factor + cost for cost in PRODUCT.costs)
    dear = Relation("R", 2, Semantics.SOFT, PRODUCT.tuples, costs, 0)
    pairs = ("AB", "BC", "AC")
    constraints = [Constraint("C", dear, tuple(pair), tuple(pair)) for pair in pairs]
    team = with_costs(team_of(dict.fromkeys("ABC", (2, 3)), constraints))
    assert solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)).cost == 3 * (5 * factor + 4)


@pytest.mark.parametrize("withdraw", [None, Withdrawal.FEWEST])
def test_a_run_over_the_limit_says_the_same_in_every_runtime(withdraw: Withdrawal | None) -> None:
    team = products("ABCDE", "AB BC AC AD BD CD AE")
    said = []
    for runtime in Runtime:
        options = Options(protocol="dpop", runtime=runtime, settings={"memory": "100"}, withdraw=withdraw)
        with pytest.raises(Unsupported) as refused:
            solve(team, options)
        said.append(str(refused.value))
    assert said[0] == said[1]
    assert re.match(r"R[CD] needs [\d,]+ bytes for its tables, more than 100: .* induced width 3 ", said[0])
    assert "dpop" not in said[0]


@pytest.mark.parametrize("memory", ["0", "-1", "much"])
def test_what_is_no_number_of_bytes_is_refused(memory: str) -> None:
    with pytest.raises(Unsupported, match=r"--set: .*memory"):
        solve(products("AB", "AB"), Options(protocol="dpop", settings={"memory": memory}))


# What is no message of a well-behaved robot


def test_a_table_that_was_not_asked_for_is_refused() -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    told(robot, ("RA", domain()), ("RC", dimensions({"RB": 3})))
    with pytest.raises(ValueError, match="RC was not asked for a table"):
        told(robot, ("RC", UTIL(1, bytes(3))))


@pytest.mark.parametrize("costs", [b"", bytes(4), bytes([10, 0, 0])])
def test_a_table_of_another_size_or_costs_above_the_bound_is_refused(costs: bytes) -> None:
    robot = begun(products("AB", "AB"), "RA", below="B")
    told(robot, ("RB", dimensions({"RA": 3})))
    with pytest.raises(ValueError, match=r"no piece|more than the most"):
        told(robot, ("RB", UTIL(1, costs)))


def test_children_that_contradict_each_other_are_refused() -> None:
    robot = begun(products("ABCD", "AB BC BD"), "RB", "A", "CD")
    with pytest.raises(ValueError, match="RC says that RA has 4 values"):
        told(robot, ("RA", domain()), ("RC", dimensions({"RA": 4})), ("RD", dimensions({"RA": 3})))


@pytest.mark.parametrize(
    ("sender", "message"), [("RC", dimensions({"RB": 9})), ("RA", dimensions({})), ("RC", domain())]
)
def test_who_speaks_twice_or_out_of_place_is_refused(sender: str, message: Message) -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    told(robot, ("RC", dimensions({"RB": 3})))
    with pytest.raises(ValueError, match=f"{sender} had nothing to say"):
        told(robot, (sender, message))


def test_who_has_no_room_does_not_proceed() -> None:
    """Though a root should never let it."""
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    told(robot, ("RA", domain()), ("RC", dimensions({"RB": 3, **{f"R{number}": 10**9 for number in range(9)}})))
    with pytest.raises(ValueError, match="no room"):
        told(robot, ("RA", Proceed(["RA", *(f"R{number}" for number in range(9))])))


@pytest.mark.parametrize(
    "said",
    [
        dimensions({f"R{number}": 2 for number in range(100_000)}),
        dimensions({"RA": 3}, width=-5),
        dimensions({"RA": 3}, most=Need(math.nan, "RC")),
        dimensions({"RA": 3}, most=Need(-1, "RC")),
    ],
)
def test_dimensions_that_cannot_be_are_refused(said: Dimensions) -> None:
    robot = begun(products("ABC", "AB BC"), "RB", "A", "C")
    with pytest.raises(ValueError, match="cannot be"):
        told(robot, ("RC", said))


def test_axes_that_are_not_the_separator_s_are_refused() -> None:
    with pytest.raises(ValueError, match="is none"):
        told(leaf(products("ABC", "AB BC AC")), ("RB", Proceed(["RB"])))


@pytest.mark.parametrize("assignment", [[], [0], [0, 3], [-1, 0]])
def test_values_that_are_none_are_refused(assignment: list[int]) -> None:
    robot = leaf(products("ABC", "AB BC AC"))
    told(robot, ("RB", Proceed(["RB", "RA"])))
    with pytest.raises(ValueError, match="are no values of RB, RA"):
        told(robot, ("RB", VALUE(assignment)))


def test_a_value_that_comes_twice_is_refused() -> None:
    robot = leaf(products("ABC", "AB BC AC"))
    told(robot, ("RB", Proceed(["RB", "RA"])), ("RB", VALUE([0, 0])))
    with pytest.raises(ValueError, match="RC has a value already"):
        told(robot, ("RB", VALUE([0, 0])))


def test_the_limit_is_the_robots_too() -> None:
    """As the run's settings reach them."""
    with pytest.raises(TooMuch):
        Simulation(products("AB", "AB"), DPOP, RandomChannels(0), brief=Brief(settings={"memory": "9"})).run()


def test_the_docstring_shows_what_happens() -> None:
    assert doctest.testmod(robochoc.protocols.dpop).failed == 0
