"""Orders of the robots, and teams turned around to follow them: the same problem, well-formed, told to who needs it."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from robochoc.formats import read_team, write_team
from robochoc.formats.global_constraints import read_form
from robochoc.formats.robot_writer import with_distinct_names
from robochoc.generators.queens3d import queens3d
from robochoc.model.absence import may_count_when_absent
from robochoc.model.orders import Order, OrderError, compute_order, constraint_graph, with_order, with_priorities
from robochoc.model.priorities import natural_key
from robochoc.model.problem import Child, Constraint, ConstraintModel, Parent, Relation, ScenarioEvent, Semantics
from robochoc.protocols.order import PseudoTree
from robochoc.run import Options, Runtime, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.brute_force import solutions
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.problems import random_team, shuffled, team_of, with_unique_definitions
from tests.support.small_teams import DIFFERENT, graph_team, pkc_team

SIMULATED = Options(runtime=Runtime.SIMULATOR, cache=False)


def meaning(constraint: Constraint) -> Constraint:
    """`constraint`, whatever its definition is called."""
    return replace(constraint, definition=replace(constraint.definition, name=""))


def letters(names: Sequence[str]) -> str:
    return "".join(name.removeprefix("R") for name in names)


# The team, turned around


@pytest.mark.parametrize("make", [random_team, random_complex_team])
def test_the_problem_stays_the_same(make: type) -> None:
    chance = Random(f"same {make.__name__}")
    for number in range(100):
        team = make(chance)
        names = shuffled(chance, team)
        turned = with_priorities(team, names)
        assert turned.order == tuple(names)
        assert Counter(map(meaning, turned.constraints())) == Counter(map(meaning, team.constraints()))
        assert turned.owner == team.owner
        if number > 20:
            continue
        keys = sorted(team.variables)
        assert {tuple(one[key] for key in keys) for one in solutions(turned)} == {
            tuple(one[key] for key in keys) for one in solutions(team)
        }


@pytest.mark.parametrize("make", [random_team, random_complex_team])
def test_each_constraint_stands_with_its_lowest_robot_and_the_others_are_its_parents(make: type) -> None:
    chance = Random(f"lowest {make.__name__}")
    for _ in range(200):
        team = make(chance)
        turned = with_priorities(team, shuffled(chance, team))
        rank = {name: place for place, name in enumerate(turned.order)}
        for robot in turned.robots:
            parents = {parent.name for parent in robot.parents}
            assert all(rank[parent] < rank[robot.name] for parent in parents)
            for constraint in robot.shared:
                owners = {turned.owner[name] for name in constraint.variables}
                assert max(owners, key=rank.__getitem__) == robot.name
                assert owners - {robot.name} <= parents


@pytest.mark.parametrize("make", [random_team, random_complex_team])
def test_the_files_of_the_team_are_valid_and_say_the_same(make: type, tmp_path: Path) -> None:
    chance = Random(f"files {make.__name__}")
    for number in range(40):
        team = with_unique_definitions(make(chance))
        turned = with_priorities(team, shuffled(chance, team))
        write_team(turned, tmp_path / str(number))
        again = read_team(tmp_path / str(number))
        for robot in turned.robots:
            assert (again[robot.name].parents, again[robot.name].children) == (robot.parents, robot.children)


def test_a_turned_team_is_what_its_author_would_have_written() -> None:
    """Held against the tests' own construction of a team from its constraints and an order."""
    chance = Random("author")
    for _ in range(200):
        team = random_complex_team(chance)
        names = shuffled(chance, team)
        owned = {name: [variable.name for variable in team[name].variables] for name in names}
        domains = {name: list(variable.domain) for name, variable in team.variables.items()}
        constraints = [one for robot in team.robots for one in (*robot.shared, *robot.private)]
        constraints = [replace(one, model=ConstraintModel.TKC) for one in constraints]
        written = complex_team(owned, domains, constraints)
        turned = with_priorities(team, names)
        for name in names:
            mine, theirs = turned[name], written[name]
            assert Counter(map(meaning, mine.shared)) == Counter(map(meaning, theirs.shared))
            assert {one.name for one in mine.parents} == {one.name for one in theirs.parents}
            assert {one.name: {*one.variables} for one in mine.children} == {
                one.name: {*one.variables} for one in theirs.children
            }


def test_turning_back_gives_the_team_again() -> None:
    chance = Random("back")
    for _ in range(100):
        team = random_complex_team(chance)
        back = with_priorities(with_priorities(team, shuffled(chance, team)), team.order)
        for name in team.order:
            told = {one.name: {*one.variables} for one in team[name].children}
            assert {one.name: {*one.variables} for one in back[name].children} == told
            held = {one.name: Counter(map(meaning, one.constraints)) for one in team[name].parents}
            assert {one.name: Counter(map(meaning, one.constraints)) for one in back[name].parents} == held


def test_the_same_order_is_the_same_team() -> None:
    team = queens3d(3)
    assert with_priorities(team, team.order) is team
    assert with_order(team, None) is team
    assert with_order(team, Order.GIVEN) is team


def test_an_order_has_to_name_each_robot_once() -> None:
    team = graph_team(["AB"])
    for names in ([], ["RA"], ["RA", "RA"], ["RA", "RX"], ["RA", "RB", "RB"]):
        with pytest.raises(ValueError, match="each robot"):
            with_priorities(team, names)


def test_a_link_without_constraints_stays_a_link() -> None:
    team = graph_team(["AB"], {"C": 2})
    above, _, alone = team.robots
    linked = replace(
        team,
        robots=(
            replace(above, children=(*above.children, Child("RC", ("A",)))),
            team["RB"],
            replace(alone, parents=(Parent("RA"),)),
        ),
    )
    same_way = with_priorities(linked, ["RA", "RC", "RB"])
    assert [one.name for one in same_way["RC"].parents] == ["RA"]
    assert Child("RC", ("A",)) in same_way["RA"].children
    turned = with_priorities(linked, ["RC", "RB", "RA"])
    assert turned["RC"].children == (Child("RA"),)
    assert Parent("RC") in turned["RA"].parents


def test_a_link_of_a_constraint_that_is_held_elsewhere_goes() -> None:
    rows = ((1, 1, 1), (2, 2, 2))
    scope = ("A", "B", "C")
    same = Constraint("C", Relation("same", 3, Semantics.SUPPORTS, rows), scope, scope)
    turned = with_priorities(team_of(dict.fromkeys("ABC", (1, 2)), [same]), ["RC", "RB", "RA"])
    assert {one.name for one in turned["RA"].parents} == {"RB", "RC"}
    assert not turned["RB"].parents
    # The links leave open who of the two comes first; a reader takes the natural order, in which RC is the lower.
    assert [one.constraints for one in turned["RA"].parents if one.name == "RC"] == [(same,)]


def test_what_a_child_is_told_beyond_its_constraints_it_goes_on_being_told() -> None:
    team = complex_team({"R1": ["A", "B"], "R2": ["C"], "R3": ["D"]}, {name: [1, 2] for name in "ABCD"}, [])
    differ = Constraint("C", DIFFERENT, ("A", "C"), ("A", "C"))
    first, second, third = team.robots
    told = replace(
        team,
        robots=(
            replace(first, children=(Child("R2", ("B", "A")),)),
            replace(second, parents=(Parent("R1", (differ,)),)),
            third,
        ),
    )
    assert with_priorities(told, ["R1", "R3", "R2"])["R1"].children == (Child("R2", ("B", "A")),)
    assert with_priorities(told, ["R2", "R3", "R1"])["R2"].children == (Child("R1", ("C",)),)


def test_a_link_stays_for_what_is_told_beyond_constraints() -> None:
    scope = ("A", "C", "D")
    three = Constraint("C", Relation("same", 3, Semantics.SUPPORTS, ((1, 1, 1),)), scope, scope)
    values = {name: [1, 2] for name in "ABCD"}
    team = complex_team({"R1": ["A", "B"], "R2": ["C"], "R3": ["D"]}, values, [three])
    told = replace(team, robots=(replace(team["R1"], children=(Child("R3", ("A", "B")),)), team["R2"], team["R3"]))
    assert with_priorities(told, ["R1", "R3", "R2"])["R1"].children == (Child("R3", ("B",)), Child("R2", ("A",)))
    assert with_priorities(team, ["R1", "R3", "R2"])["R1"].children == (Child("R2", ("A",)),)


def test_definitions_of_one_name_in_two_files_do_not_become_one() -> None:
    def apart(first: str, second: str, *rows: tuple[int, int]) -> Constraint:
        return Constraint("C", Relation("R", 2, Semantics.CONFLICTS, rows), (first, second), (first, second))

    given = [apart("A", "B", (1, 1)), apart("A", "C", (2, 2)), apart("A", "D", (2, 2)), apart("A", "E", (1, 1))]
    turned = with_priorities(team_of(dict.fromkeys("ABCDE", (1, 2)), given), ["RB", "RC", "RD", "RE", "RA"])
    assert [one.definition for one in turned["RA"].shared] == [one.definition for one in given]
    written = with_distinct_names(turned["RA"])
    assert [one.definition.name for one in written.shared] == ["R", "R.2", "R.2", "R"]
    assert [meaning(one) for one in written.shared] == [meaning(one) for one in given]


def test_global_constraints_are_of_the_same_kind_in_every_order() -> None:
    kind, rows = (
        "global:cumulative",
        ("[ {X0 2 1} {X1 2 1} {X2 2 1} ] <le/> 1", "[ {X0 1 2} {X1 1 2} {X2 1 2} ] <le/> 2"),
    )
    scopes = ("A", "B", "C"), ("A", "B", "D")
    given = [Constraint("C", read_form(kind, row), scope, scope) for row, scope in zip(rows, scopes, strict=True)]
    turned = with_priorities(team_of(dict.fromkeys("ABCD", (1, 2)), given), ["RD", "RC", "RB", "RA"])
    assert [one.definition.name for one in turned["RA"].shared] == [kind, kind]
    assert all(may_count_when_absent(one) for one in turned.constraints())


def test_a_partially_known_constraint_stays_as_it_is_held() -> None:
    turned = with_priorities(pkc_team(), ["RX", "RA", "RB"])
    assert turned["RA"].children == pkc_team()["RA"].children
    assert [one.model for one in turned["RB"].shared] == [ConstraintModel.PKC, ConstraintModel.TKC]
    with pytest.raises(OrderError, match=r"RB .*PKC, C.* RA before it"):
        with_priorities(pkc_team(), ["RX", "RB", "RA"])
    with pytest.raises(UnsupportedError, match="PKC"):
        solve(pkc_team(), replace(SIMULATED, order=("RB", "RA", "RX")))


def test_a_team_with_a_scenario_keeps_its_order() -> None:
    team = replace(graph_team(["AB"]), scenario=(ScenarioEvent(()),))
    assert with_priorities(team, team.order) is team
    with pytest.raises(OrderError, match=r"scenario\.xml"):
        with_priorities(team, ["RB", "RA"])


# Orders by name


def test_neighbours_are_those_of_a_constraint_and_of_a_link() -> None:
    scope = ("A", "B", "C")
    three = Constraint("C", Relation("even", 3, Semantics.SUPPORTS, ((1, 1, 1),)), scope, scope)
    graph = constraint_graph(team_of(dict.fromkeys("ABCD", (1, 2)), [three]))
    assert graph == {"RA": {"RB", "RC"}, "RB": {"RA", "RC"}, "RC": {"RA", "RB"}, "RD": frozenset()}


def test_the_order_of_a_team_does_not_change_what_orders_by_name_say() -> None:
    chance = Random("names")
    for _ in range(30):
        team = random_team(chance)
        turned = with_priorities(team, shuffled(chance, team))
        for order in set(Order) - {Order.GIVEN}:
            assert sorted(compute_order(team, order)) == sorted(team.order)
            if all(len(constraint.variables) < 3 for constraint in team.constraints()):
                assert compute_order(turned, order, 7) == compute_order(team, order, 7), order


def test_lexicographic_is_natural() -> None:
    team = with_priorities(queens3d(4), queens3d(4).order[::-1])
    assert compute_order(team, Order.LEXICOGRAPHIC) == tuple(sorted(team.order, key=natural_key)) == queens3d(4).order


def test_max_degree_begins_with_those_that_have_most_neighbours() -> None:
    assert letters(compute_order(graph_team(["AD", "BD", "CD", "BC"]), Order.MAX_DEGREE)) == "DBCA"


def test_min_width_has_freuders_width() -> None:
    assert letters(compute_order(graph_team(["AD", "BD", "CD", "BC"]), Order.MIN_WIDTH)) == "BCDA"
    assert letters(compute_order(graph_team([], dict.fromkeys("ABC", 2)), Order.MIN_WIDTH)) == "ABC"
    chance = Random("width")
    for _ in range(60):
        graph = constraint_graph(random_team(chance))
        widths = {names: width(graph, names) for names in itertools.permutations(graph)} if len(graph) < 7 else {}
        if widths:
            assert width(graph, order_of_graph(graph, Order.MIN_WIDTH)) == min(widths.values())


def order_of_graph(graph: Mapping[str, frozenset[str]], order: Order) -> tuple[str, ...]:
    """`order` of a team with that graph."""
    edges = [(one[1:], other[1:]) for one in graph for other in graph[one] if one < other]
    constraints = [Constraint("C", DIFFERENT, edge, edge) for edge in edges]
    return compute_order(team_of({name[1:]: (1, 2) for name in sorted(graph)}, constraints), order)


def width(graph: Mapping[str, frozenset[str]], names: Sequence[str]) -> int:
    """The most neighbours that a robot has above it (Freuder 1982)."""
    return max(len(graph[name] & {*names[:place]}) for place, name in enumerate(names))


def test_dom_deg_begins_with_the_smallest_domain_a_neighbour() -> None:
    team = graph_team(["AB", "BC", "CD", "BD"], {"A": 3, "B": 9, "C": 2, "D": 4, "E": 1})
    assert letters(compute_order(team, Order.DOM_DEG)) == "CDABE"  # 1, 2, 3, 3; E has no neighbour


def test_dom_deg_multiplies_the_domains_of_a_complex_robot() -> None:
    domains = {"A": [1, 2, 3], "B": [1, 2, 3], "C": list(range(8))}
    constraint = Constraint("C", DIFFERENT, ("A", "C"), ("A", "C"))
    team = complex_team({"R1": ["A", "B"], "R2": ["C"]}, domains, [constraint])
    assert compute_order(team, Order.DOM_DEG) == ("R2", "R1")


def test_random_follows_its_seed() -> None:
    team = graph_team([], dict.fromkeys("ABCD", 2))
    seen = Counter(compute_order(team, Order.RANDOM, seed) for seed in range(24 * 50))
    assert len(seen) == 24
    assert max(seen.values()) < 100
    assert letters(compute_order(team, Order.RANDOM, 1)) == "ADCB"
    assert compute_order(team, Order.RANDOM, 1) == compute_order(
        with_priorities(team, team.order[::-1]), Order.RANDOM, 1
    )


def test_dfs_goes_on_to_the_neighbour_with_most_neighbours() -> None:
    # E has most; of A, D, F and G it goes to D; G and H are a part of their own, I another.
    team = graph_team(["EA", "ED", "EF", "DB", "DC", "CB", "GH"], {"I": 2})
    assert letters(compute_order(team, Order.DFS)) == "DEAFBCGHI"


def test_dfs_induces_its_own_pseudo_tree() -> None:
    """Robots that share a constraint stand one above the other, and each hangs from a neighbour."""
    chance = Random("tree")
    for _ in range(150):
        team = random_team(chance)
        turned = with_order(team, Order.DFS)
        graph = constraint_graph(turned)
        links = {robot.name: [parent.name for parent in robot.parents] for robot in turned.robots}
        tree = PseudoTree.induced(turned.order, links)
        for name in team.order:
            assert graph[name] <= {*tree.ancestors(name), *tree.descendants(name)}
            assert tree.parents[name] is None or tree.parents[name] in constraint_graph(team)[name]
