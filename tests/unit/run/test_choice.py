"""The choice of a protocol: never one that is refused where another is accepted, and its answer is brute force's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations, pairwise
from math import log2, prod
from random import Random
from typing import Any

import pytest

from robochoc.generators.coloring import coloring, coloring_of
from robochoc.generators.graphs import grid, tree
from robochoc.generators.meetings import meetings
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp, random_on
from robochoc.generators.scenario import random_scenario
from robochoc.model.orders import Order
from robochoc.model.outcome import PseudoTreeNode, Verdict
from robochoc.model.problem import INFINITE, AddAgent, Change, ProblemKind, Team
from robochoc.modelling.model import Model
from robochoc.run import CENTRAL, Options, Runtime, Withdrawal, choice, solve
from robochoc.run.choice import ACCEPTS, choose, choose_for_private_team
from robochoc.run.facts import Facts, TreeTables
from robochoc.run.options import Preprocess
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from tests.support.brute_force import solutions
from tests.support.cases import cases
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, with_costs
from tests.support.examples import count
from tests.support.loose_problems import any_order, loosened, minimum_cost
from tests.support.pkc_problems import pkc_pair, pkc_part, random_pkc_team, with_private_parts
from tests.support.problems import random_team, team_of
from tests.support.random_changes import random_changing_team, stages
from tests.support.random_options import random_schedule


def changing_costs(team: Team) -> Team:
    """`team` as a DisWCSP, with those who join it."""

    def costly(change: Change) -> Change:
        if not isinstance(change, AddAgent):
            return change
        return replace(change, robot=replace(change.robot, kind=ProblemKind.DISWCSP))

    events = (replace(event, changes=tuple(map(costly, event.changes))) for event in team.scenario)
    return replace(with_costs(team), scenario=tuple(events))


def separators(tree: Mapping[str, PseudoTreeNode]) -> dict[str, set[str]]:
    """The robots above each robot that share a constraint with it, or with one below it."""

    def separator(name: str) -> set[str]:
        above = {*tree[name].pseudo_parents, *filter(None, [tree[name].parent])}
        below = (other for other, node in tree.items() if node.parent == name)
        return above.union(*map(separator, below)) - {name}

    return {name: separator(name) for name in tree}


KINDS: Mapping[str, Callable[[Random], Team]] = {
    "satisfaction": random_team,
    "costs": random_cost_team,
    "hard constraints alone": lambda chance: with_costs(random_team(chance)),
    "partially known": random_pkc_team,
    "partially known costs": lambda chance: with_costs(random_pkc_team(chance)),
    "private parts": lambda chance: with_private_parts(random_team(chance), chance),
    "several variables": random_complex_team,
    "several variables and costs": random_complex_cost_team,
    "superfluous links": lambda chance: loosened(random_team(chance), chance),
    "changes": lambda chance: random_changing_team(chance, 3),
    "changing costs": lambda chance: changing_costs(random_changing_team(chance, 3)),
    "no links": lambda _: team_of({"A": (0, 1), "B": (1,)}, []),
}
SETTINGS: tuple[dict[str, str], ...] = (
    {},
    {},
    {},
    {"memory": "100000"},
    {"batch": "2"},
    {"cycles": "20"},
    {"none": "1"},
)


def drawn(kind: str, number: int) -> tuple[Team, Options]:
    chance = Random(f"choice {kind} {number}")
    team = KINDS[kind](chance)
    options = replace(
        chance.choice((random_schedule(chance), random_schedule(chance), Options(runtime=Runtime.ARRAYS))),
        order=chance.choice((None, None, Order.GIVEN, any_order(team, chance))),
        withdraw=chance.choice((None, None, *Withdrawal)),
        settings=chance.choice(SETTINGS),
        spares=chance.choice((0, 0, 1)),
    )
    if options.spares:
        same = {name: getattr(options, name) for name in ("order", "withdraw", "spares", "settings")}
        options = Options(runtime=Runtime.PROCESSES, **same)
    return team, options


def taken(team: Team, options: Options) -> set[str]:
    """The protocols that accept the team, each asked by its name."""
    return {name for name in protocol_names() if choice.accepts(name, team, options)}


@pytest.mark.parametrize("kind", KINDS)
@count("many", 25, 1000)
def test_whatever_some_protocol_accepts_is_not_refused(kind: str, many: int) -> None:
    for number in range(many):
        team, options = drawn(kind, number)
        name = choose(team, options).options.protocol
        able = taken(team, options)
        assert name in able or not able, (kind, number)
        if any(protocol_named(one).traits.complete for one in able):
            assert protocol_named(name).traits.complete, (kind, number)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if "chang" not in kind])
@count("many", 8, 1000)
def test_the_answer_is_that_of_brute_force(kind: str, many: int) -> None:
    seen: Counter[str] = Counter()
    for number in range(many):
        team, options = drawn(kind, number)
        options = replace(options, withdraw=None, spares=0, runtime=Runtime.SIMULATOR)
        if not taken(team, options):
            continue
        outcome = solve(team, replace(options, cache=False))
        truth = minimum_cost(team)
        best = Verdict.OPTIMAL if team.kind is ProblemKind.DISWCSP else Verdict.SOLUTION
        if not protocol_named(outcome.protocol).traits.complete:
            assert outcome.verdict is not Verdict.OPTIMAL
            continue
        assert outcome.verdict is (best if truth < INFINITE else Verdict.NO_SOLUTION), (kind, number)
        assert truth in {INFINITE, outcome.cost}, (kind, number)
        assert outcome.chosen["protocol"], (kind, number)
        seen[outcome.verdict] += 1
    assert seen or kind == "partially known costs"


@pytest.mark.parametrize("kind", KINDS)
@count("many", 8, 300)
def test_where_messages_are_lost_a_protocol_that_bears_it_is_taken_if_one_accepts_the_team(
    kind: str, many: int
) -> None:
    for number in range(many):
        team, options = drawn(kind, number)
        options = replace(options, runtime=Runtime.SIMULATOR, spares=0, message_loss=(0.05, 0.3)[number % 2])
        if options.withdraw is Withdrawal.MINIMUM and team.kind is ProblemKind.DISWCSP:
            continue  # that has to be proven
        found = choose(team, options)
        able = taken(team, options)
        if any(protocol_named(one).traits.bears_loss for one in able):
            assert protocol_named(found.options.protocol).traits.bears_loss, (kind, number)
            assert "may be lost" in found.options.chosen["protocol"] or found.options.chosen["protocol"] == ACCEPTS
        assert f"messages are lost with a probability of {options.message_loss} at most" in found.facts


@count("many", 6, 300)
def test_each_epoch_of_a_problem_that_changes_is_that_of_brute_force(many: int) -> None:
    for number in range(many):
        team, options = drawn("changes", number)
        outcome = solve(team, replace(Options(runtime=Runtime.SIMULATOR), seed=options.seed))
        for now, epoch, event in zip(stages(team), outcome.epochs, [*team.scenario, None], strict=True):
            truth = Verdict.SOLUTION if any(solutions(now)) else Verdict.NO_SOLUTION
            assert epoch.verdict is truth or (epoch.verdict is Verdict.UNKNOWN and event and event.after is not None)


NAMES = "ABCDEFGHIJ"
PART = pkc_part("AB", (0, 0))
CROWDED = meetings(23, 32, 3, 7, 395737, max_value=None, model="eav")
"""32 meetings. Eight of them have common participants, and there are seven slots."""


def slots_and_tasks(robots: int) -> Team:
    """Robots that each choose one of 6 slots and one of 6 tasks; at most two robots may have the same slot."""
    model = Model("slots")
    chosen = [
        [robot.variable(name, range(6)) for name in ("slot", "task")] for robot in map(model.robot, NAMES[:robots])
    ]
    model.add([sum(slot == number for slot, _ in chosen) <= 2 for number in range(6)])
    model.add([(one != other) | (one == 0) for (_, one), (_, other) in combinations(chosen, 2)])
    model.minimize(sum(slot + 2 * task for slot, task in chosen))
    return model.team


def test_what_is_chosen() -> None:
    chosen: list[tuple[Team, dict[str, Any], str, Order | None]] = [
        (random_csp(10, 4, 0.5, 0.2), {}, "abt", None),
        (random_csp(10, 4, 0.5, 0.2), {"order": Order.DFS}, "abt", Order.DFS),
        (random_csp(10, 4, 0.5, 0.3), {}, "sbt", Order.MAX_DEGREE),
        (random_csp(20, 5, 0.3, 0.25), {}, "abt", Order.MAX_DEGREE),
        (random_csp(20, 5, 0.3, 0.25), {"order": Order.GIVEN}, "abt", None),
        (random_csp(10, 5, 0.5, 0.7), {}, "sbt", Order.MAX_DEGREE),
        (random_csp(20, 5, 1, 0.05), {}, "sfb", Order.MIN_WIDTH),
        (random_csp(12, 4, 1, 0.8, max_cost=1), {}, "sfb", Order.MAX_DEGREE),
        (random_csp(20, 5, 0.3, 0.6), {}, "sfb", Order.MIN_WIDTH),
        (random_csp(20, 5, 0.3, 0.6), {"order": Order.GIVEN}, "sfb", None),
        (coloring_of(grid(8, 8), 3, conflicts="hard"), {}, "sbt", None),
        (coloring(200, 3, 3.5, conflicts="hard"), {}, "abt", Order.MAX_DEGREE),
        (coloring(200, 3, 4.5, conflicts="hard"), {}, "sfb", Order.MIN_WIDTH),
        (queens3d(3), {}, "sbt", Order.MAX_DEGREE),
        (CROWDED, {}, "sfb", Order.MIN_WIDTH),
        (CROWDED, {"order": Order.GIVEN}, "sfb", None),
        (random_csp(10, 4, 0.5, 0.3), {"withdraw": Withdrawal.MINIMUM}, "sfb", Order.DOM_DEG),
        (random_csp(10, 4, 0.5, 0.3), {"withdraw": Withdrawal.MAXIMAL}, "sfb", None),
        (random_csp(10, 4, 0.5, 0, max_cost=9), {}, "dpop", None),
        (random_csp(14, 8, 0.9, 0, max_cost=9), {}, "sfb", Order.MAX_DEGREE),
        (coloring(30, 3, 2), {}, "ncbb", None),
        (random_on(tree(30), 4, 0, max_cost=9), {}, "dpop", None),
        (random_on(tree(6), 4, 0, max_cost=9), {}, "sfb", Order.MAX_DEGREE),
        (random_on(grid(20, 20), 4, 0, max_cost=9), {}, "dsa", None),
        (random_on(grid(20, 20), 4, 0.1, max_cost=9), {}, "sfb", Order.MAX_DEGREE),
        (coloring(400, 3, 3, conflicts="hard"), {}, "abt", Order.MAX_DEGREE),
        (pkc_pair(PART, PART), {}, "disfc", None),
        (random_scenario(random_csp(12, 5, 0.5, 0.2), 2, 0.1), {}, "dynabt", None),
        (random_scenario(random_csp(20, 3, 0.15, 0, max_cost=9), 2, 0.1), {}, "s-dpop", None),
        (random_scenario(random_csp(6, 3, 0.2, 0, max_cost=9), 2, 0.1), {}, "sfb", None),
        (random_scenario(random_csp(12, 5, 0.5, 0.5), 2, 0.1), {}, "sfb", None),
        (random_scenario(random_csp(30, 5, 0.2, 0.5), 2, 0.1), {}, "dynabt", None),
        (team_of({"A": range(3000), "B": range(3000)}, []), {}, "sfb", Order.MIN_WIDTH),
        (coloring(300, 300, 3, conflicts="hard"), {}, "abt", None),
        (queens3d(5, "full", "rows"), {}, "sfb", Order.MIN_WIDTH),
        (queens3d(6, "full", "rows"), {}, "afc-ng", Order.MAX_DEGREE),
        (slots_and_tasks(8), {}, "dpop", None),
        (slots_and_tasks(10), {}, "sfb", Order.MAX_DEGREE),
        (slots_and_tasks(10), {"withdraw": Withdrawal.MINIMUM}, "afb", Order.MAX_DEGREE),
        (random_csp(10, 4, 0.5, 0.3), {"message_loss": 0.1}, "gdba", None),
        (random_csp(10, 4, 0.5, 0.3), {"message_loss": 0.2}, "dsa", None),
        (random_csp(10, 4, 0.5, 0, max_cost=9), {"message_loss": 0.1}, "maxsum", None),
        (random_csp(10, 4, 0.5, 0.3, max_cost=9), {"message_loss": 0.1}, "regret-matching", None),
        (random_scenario(random_csp(12, 5, 0.5, 0.2), 2, 0.1), {"message_loss": 0.1}, "gdba", None),
        (pkc_pair(PART, PART), {"message_loss": 0.1}, "acls", None),
        (with_costs(pkc_pair(PART, PART)), {"message_loss": 0.1}, "acls", None),
    ]
    with cases() as each:
        for team, options, protocol, order in chosen:
            with each((protocol, options)):
                runtime = Runtime.SIMULATOR if "message_loss" in options else Runtime.PROCESSES
                asked = replace(Options(runtime=runtime), **options)
                found = choose(team, asked)
                assert (found.options.protocol, found.options.order) == (protocol, order)
                assert ("order" in found.options.chosen) is (order is not None and asked.order is None)
                assert found.facts
                assert protocol not in dict(found.rejected)
                assert choose(team, found.options).options == found.options


def test_a_crowd_is_reported_and_the_search_ends() -> None:
    outcome = solve(CROWDED, Options(runtime=Runtime.SIMULATOR, cache=False))
    assert (outcome.protocol, outcome.verdict) == ("sfb", Verdict.NO_SOLUTION)
    found = choose(CROWDED, Options())
    assert "8 robots need different values, and have only 7" in found.facts
    assert "a group of robots needs more different values than it has" in dict(found.rejected)["abt"]


def test_what_was_asked_for_is_not_changed() -> None:
    team = random_csp(10, 4, 0.5, 0.3)
    for name in (*protocol_names(), CENTRAL):
        asked = Options(protocol=name)
        assert choose(team, asked).options == choose_for_private_team(team, asked).options == asked


def test_an_order_that_nobody_has_given_is_chosen_for_any_protocol() -> None:
    team = random_csp(10, 4, 0.5, 0.3)
    options = choose(team, Options(protocol="abt"), ordered=False).options
    assert options.order is Order.MAX_DEGREE
    assert list(options.chosen) == ["order"]
    asked = Options(protocol="abt", order=Order.DFS)
    assert choose(team, asked, ordered=False).options == asked
    pkc = pkc_pair(PART, PART)
    assert choose(pkc, Options(protocol="abt"), ordered=False).options.order is None


def test_where_nobody_accepts_the_team_the_refusal_names_who_may() -> None:
    team = with_costs(pkc_pair(PART, PART))
    assert not taken(team, Options(spares=1))
    with pytest.raises(UnsupportedError, match="PKC"):
        solve(team, Options(spares=1))


def test_of_robots_that_keep_their_constraints_the_kind_is_known() -> None:
    for team, name in ((random_csp(4, 3, 1, 0.3), "abt"), (random_csp(4, 3, 1, 0, max_cost=5), "sfb")):
        options = choose_for_private_team(team, Options(runtime=Runtime.NETWORK)).options
        assert (options.protocol, options.order) == (name, None)
        assert options.chosen["protocol"]


def test_how_much_is_forbidden_is_what_counting_says() -> None:
    """Kappa of random problems: half the density, times the robots less one, times the bits of a constraint."""
    for tightness in (0.2, 0.4, 0.6):
        found = Facts(random_csp(12, 5, 0.5, tightness)).constrainedness
        assert found == pytest.approx(33 * log2(1 / (1 - tightness)) / (12 * log2(5)))
    assert Facts(random_csp(2, 40, 1, 0.5)).constrainedness == pytest.approx(1 / (2 * log2(40)), rel=0.3)  # by drawing
    assert Facts(team_of({"A": (1,), "B": (1,)}, [])).constrainedness == 0
    assert Facts(random_csp(2, 5, 1, 1)).constrainedness > 1


def test_parents_leave_a_value_only_if_all_constraints_together_leave_it() -> None:
    """Three constraints of a pair may exclude a third of the values each, and a robot's variables exclude others'."""
    model = Model("chain")
    first, second = (model.robot(name).variable(name, range(3)) for name in "AB")
    model.add(first != second, first != second + 1)
    assert Facts(model.team).needs_no_backtracking
    model.add(first != second + 2, first != second - 1, first != second - 2)
    assert not Facts(model.team).needs_no_backtracking
    assert model.solve(runtime="simulator").verdict == Verdict.NO_SOLUTION
    model = Model("two variables of a robot")
    first, robot = model.robot("A").variable("A", range(2)), model.robot("B")
    second, third = (robot.variable(name, range(2)) for name in "CD")
    model.add(first != second, first != third, second != third)
    assert not Facts(model.team).needs_no_backtracking


def test_what_something_outside_changes_is_left_to_who_keeps_what_holds() -> None:
    team = random_csp(12, 5, 0.5, 0.5)
    assert choose(team, Options(), environment=True).options.protocol == "dynabt"


@count("many", 10, 200)
def test_the_tree_is_the_one_that_robots_build(many: int) -> None:
    chance = Random("tree")
    for _ in range(many):
        team = random_cost_team(chance)
        built = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR)).tree
        if not built:  # a robot alone has no value
            continue
        found = separators(built)
        sizes = Facts(team).declared_sizes
        cells = [prod(sizes[one] for one in (name, *above)) for name, above in found.items()]
        assert Facts(team).tree == TreeTables(max(map(len, found.values())), max(cells))


def test_the_tree_of_robots_with_several_variables_has_divided_tables() -> None:
    def model(*, private: bool) -> Model:
        found = Model("chain")
        owned = []
        for number in range(8):
            robot = found.robot(f"R{number}")
            owned.append(
                (robot.variable("slot", range(3)), robot.variable("task", range(5)), robot.variable("own", range(9)))
            )
            if private:
                found.add(owned[-1][0] + owned[-1][2] <= owned[-1][1] + 8)
        for (slot, task, _), (next_slot, next_task, _) in pairwise(owned):
            found.add(slot != next_slot, cost=1)
            found.add(task != next_task, cost=2)
        return found

    assert Facts(model(private=False).team).tree == TreeTables(1, 25)
    assert Facts(model(private=True).team).tree == TreeTables(1, 15 * 15)
    assert Facts(model(private=False).team, withdrawal=True).tree == TreeTables(1, 15 * 15)
    assert Facts(model(private=False).team, environment=True).tree == TreeTables(1, 15 * 15)
    chosen = model(private=False).solve(protocol="dpop", runtime="simulator")
    assert chosen.metrics.messages["SplitDimensions"] == 7


@pytest.mark.parametrize(("maximise", "fact"), [(False, "costs are minimised"), (True, "utilities are maximised")])
def test_the_facts_name_the_objective_of_the_files(maximise: bool, fact: str) -> None:  # noqa: FBT001 - a parameter
    model = Model("m")
    one = model.robot("r").variable("x", range(3))
    (model.maximize if maximise else model.minimize)(one)
    assert fact in choose(model.team, Options(protocol="auto", runtime=Runtime.SIMULATOR)).facts


def test_no_protocol_that_ignores_costs_is_chosen_for_a_minimum() -> None:
    """All protocols that minimise refuse --preprocess here, so the run is refused."""
    options = Options(protocol="auto", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM, preprocess=Preprocess.AC)
    team = random_csp(12, 4, 0.4, 0.0, 3, max_cost=9)
    assert protocol_named(choose(team, options).options.protocol).traits.costs
    with pytest.raises(UnsupportedError, match="values that are possible if other robots withdraw"):
        solve(team, options)
