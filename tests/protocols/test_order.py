"""The total order, and the pseudo-tree that it induces (Dechter, "Constraint Processing", 2003, Section 4.5)."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.model.problem import Team
from robochoc.protocols.order import PriorityOrder, PseudoTree
from robochoc.solver.agent_problem import AgentProblem, agent_problems
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.complex_problems import random_complex_team
from tests.support.examples import examples
from tests.support.problems import random_team, teams

EVERY = examples(50)
complex_teams = st.integers(0, 2**32).map(lambda seed: random_complex_team(Random(seed)))


def parts_of(team: Team) -> dict[str, AgentProblem]:
    """What each robot is told of the others, of their tree too."""
    with Compiler() as compiler:
        return agent_problems(CompiledTeam(team, lambda robot: compiler.compile(robot).domain), tree=True)


def order_of(team: Team) -> PriorityOrder:
    """The order of `team` with its tree, as a robot is told of it."""
    part = parts_of(team)[team.order[0]]
    return PriorityOrder(part.order, part.known.links)


def tree_of(team: Team) -> PseudoTree:
    tree = order_of(team).tree
    assert tree is not None
    return tree


def induced(links: Mapping[str, str]) -> PseudoTree:
    """The tree for robots in the order of `links`, names of one letter."""
    return PseudoTree.induced(tuple(links), links)


def connected(team: Team) -> dict[str, set[str]]:
    """For each robot all robots of its part of the team."""
    part = {name: {name} for name in team.order}
    for constraint in team.constraints():
        joined = set().union(*(part[team.owner[name]] for name in constraint.variables))
        for name in joined:
            part[name] = joined
    return part


def test_the_lowest_robot_stands_last_in_the_order() -> None:
    assert PriorityOrder("BAC").lowest({"A", "B"}) == "A"
    with pytest.raises(ValueError, match="empty"):
        PriorityOrder("BAC").lowest(())


def test_depth_is_the_place_of_the_lowest_robot_and_before_all_for_none() -> None:
    assert PriorityOrder("BAC").depth({"A", "B"}) == 1
    assert PriorityOrder("BAC").depth(()) == -1
    assert PriorityOrder("BAC").tree is None, "no tree is made unless it is asked for"


def test_a_tree_parent_is_the_lowest_of_those_above_also_of_those_that_a_child_hands_up() -> None:
    for b_knows in ("A", ""):
        assert induced({"A": "", "B": b_knows, "C": "AB"}).parents == {"A": None, "B": "A", "C": "B"}


def test_robots_without_a_constraint_between_them_stand_on_branches_of_their_own() -> None:
    tree = induced({"A": "", "B": "A", "C": "A", "D": "B"})
    assert tree.children == {"A": ["B", "C"], "B": ["D"], "C": [], "D": []}


def test_ancestors_go_up_to_the_root_and_descendants_down_each_after_its_parent() -> None:
    tree = induced({"A": "", "B": "A", "C": "A", "D": "B", "E": "D"})
    assert tree.ancestors("E") == ["D", "B", "A"]
    assert tree.ancestors("A") == []
    assert sorted(tree.descendants("A")) == ["B", "C", "D", "E"]
    assert tree.descendants("B") == ["D", "E"]
    assert tree.descendants("E") == []


def test_a_robot_alone_is_a_root() -> None:
    assert set(induced({"A": "", "B": "", "C": "A"}).roots) == {"A", "B"}


@EVERY
@given(teams | complex_teams)
def test_a_tree_has_every_constraint_on_one_branch_and_goes_on_as_early_as_it_can(team: Team) -> None:
    """Priority decreases along branches, and the root of each unconnected part is its highest robot."""
    tree, place = tree_of(team), team.order.index
    met = [{team.owner[variable] for variable in constraint.variables} for constraint in team.constraints()]
    for robots in met:
        *above, lowest = sorted(robots, key=place)
        assert {*above} <= {*tree.ancestors(lowest)}
    for name, parent in tree.parents.items():
        assert all((other in tree.ancestors(name)) is (name in tree.descendants(other)) for other in team.order)
        if parent is not None:
            subtree = {name, *tree.descendants(name)}
            assert place(parent) < place(name)
            assert any(parent in robots and robots & subtree for robots in met), "else the root could stand higher"
    assert {*tree.roots} == {min(part, key=place) for part in connected(team).values()}


@EVERY
@given(teams)
def test_every_robot_induces_the_same_tree(team: Team) -> None:
    trees = [PriorityOrder(part.order, part.known.links).tree for part in parts_of(team).values()]
    assert len({str(tree and tree.parents) for tree in trees}) == 1


def test_random_teams_have_trees_with_branches_and_several_roots() -> None:
    """Or else the properties above would say little."""
    trees = [tree_of(random_team(Random(seed))) for seed in range(100)]
    assert sum(len(tree.roots) > 1 for tree in trees) > 10
    assert sum(any(len(children) > 1 for children in tree.children.values()) for tree in trees) > 10
