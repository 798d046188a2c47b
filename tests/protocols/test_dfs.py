"""The pseudo-tree that robots build: the rules of `shared/dfs.py` one by one, and what it promises, on any graph."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from random import Random
from typing import ClassVar

from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.graphs import grid
from robochoc.generators.random_csp import random_on
from robochoc.journal.events import Event, Sent
from robochoc.model.outcome import PseudoTreeNode, Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.shared.messages.dfs import Back, Token, TreeMessage, Wave
from robochoc.protocols.traits import Traits
from robochoc.run import Options, Runtime, solve
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import replies, robot_of, started, started_robot
from tests.support.examples import examples
from tests.support.limits import HANG_S
from tests.support.local_search_runs import any_schedule
from tests.support.problems import team_of


class Hello(Message, frozen=True):
    """Somebody has begun."""


class Greeter(TreeProtocol):
    """Greets all neighbours when it begins; `made` are all that there are, by name."""

    messages = TreeMessage | Hello
    traits = Traits(costs=True, shared_scopes=True)
    made: ClassVar[dict[str, Greeter]] = {}

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.begun = 0
        self.decided = 0
        self.greeted: list[str] = []
        self.early = 0
        self.made[problem.agent] = self

    def receive(self, sender: str, message: Message) -> None:
        self.early += isinstance(message, Hello) and not self.placed
        super().receive(sender, message)

    def start_in_tree(self) -> None:
        assert self.placed
        assert not self.greeted
        self.begun += 1
        self.value = 0
        for name in (*self.ancestors, *self.descendants):
            self.send(name, Hello())

    def handle(self, sender: str, message: Message) -> None:
        assert self.begun
        assert message == Hello()
        self.greeted.append(sender)

    def decide(self) -> None:
        assert self.begun
        self.decided += 1


def graph(names: str, scopes: str) -> Team:
    """A robot for each letter, and a constraint over each of `scopes`."""

    def constraint(scope: str) -> Constraint:
        return Constraint("C", Relation("R", len(scope), Semantics.CONFLICTS, ()), tuple(scope), tuple(scope))

    return team_of(dict.fromkeys(names, (1,)), [constraint(scope) for scope in scopes.split()])


def random_graph(chance: Random) -> Team:
    """1 to 10 robots, in one part or several, with constraints over two to four of them."""
    names = "ABCDEFGHIJ"[: chance.randint(1, 10)]
    density = chance.choice((0.1, 0.2, 0.4, 0.8, 1))
    scopes = [first + second for first, second in itertools.combinations(names, 2) if chance.random() < density]
    if len(names) > 3 and chance.random() < 0.4:
        scopes += ["".join(chance.sample(names, chance.choice((3, 4)))) for _ in range(2)]
    return graph(names, " ".join(scopes))


def neighbours_of(team: Team) -> dict[str, set[str]]:
    """Who shares a constraint with whom."""
    met: dict[str, set[str]] = {name: set() for name in team.order}
    for constraint in team.constraints():
        owners = {team.owner[name] for name in constraint.variables}
        for name in owners:
            met[name] |= owners - {name}
    return met


def expected(team: Team) -> dict[str, PseudoTreeNode]:
    """The tree that a depth-first search without any messages finds."""
    met = neighbours_of(team)
    strength = {name: (len(met[name]), -rank) for rank, name in enumerate(team.order)}
    places: dict[str, PseudoTreeNode] = {}

    def visit(name: str, parent: str | None) -> None:
        above = tuple(other for other in team.order if other in places and other in met[name] and other != parent)
        places[name] = PseudoTreeNode(parent, above)
        while left := [other for other in met[name] if other not in places]:
            visit(max(left, key=strength.__getitem__), name)

    for name in sorted(team.order, key=strength.__getitem__, reverse=True):
        if name not in places:
            visit(name, None)
    return places


def above(places: Mapping[str, PseudoTreeNode], name: str) -> Iterator[str]:
    """Those on the way from `name` to its root."""
    parent = places[name].parent
    while parent is not None:
        yield parent
        parent = places[parent].parent


def played(team: Team, chance: Random) -> tuple[SearchResult, dict[str, Greeter]]:
    Greeter.made.clear()
    return Simulation(team, Greeter, any_schedule(chance)).search(), dict(Greeter.made)


@given(chance=st.randoms(use_true_random=False))
@examples(100)
def test_every_schedule_builds_the_tree_of_a_depth_first_search(chance: Random) -> None:
    """The root has the most neighbours of its part, a token goes to the neighbour with the most; ties by priority.

    Neighbours stand one above the other: all robots of an n-ary constraint on one branch, as any two of them do. A
    token passes twice between a robot and its parent, and a wave along each edge both ways. Each begins once.
    """
    team = random_graph(chance)
    result, robots = played(team, chance)
    assert result.verdict is Verdict.SOLUTION
    places = {name: found.place for name, found in result.findings.items() if found.place is not None}
    assert places == expected(team)
    met = neighbours_of(team)
    for name, robot in robots.items():
        ancestors = set(above(places, name))
        descendants = {other for other in places if name in above(places, other)}
        assert set(robot.ancestors) == met[name] & ancestors
        assert set(robot.descendants) == met[name] & descendants
        assert met[name] <= ancestors | descendants
        assert set(robot.children) == {other for other, place in places.items() if place.parent == name}
        for names in (robot.pseudo_parents, robot.children, robot.pseudo_children):
            assert list(names) == sorted(names, key=team.order.index)
        assert robot.begun == 1
        assert robot.decided
        assert sorted(robot.greeted) == sorted(met[name])
    joined, edges = sum(robot.parent is not None for robot in robots.values()), sum(map(len, met.values()))
    messages = Counter(result.metrics.messages)
    assert (messages["Token"], messages["Back"], messages["Hello"]) == (joined, joined, edges)
    assert messages["Wave"] >= edges


@given(chance=st.randoms(use_true_random=False))
@examples(100)
def test_the_token_names_who_is_in_the_tree_while_a_neighbour_has_not_heard_so(chance: Random) -> None:
    """No others, and each with the number of these neighbours: not counted are leaves, which need no list."""
    team = random_graph(chance)
    met = neighbours_of(team)
    heard: dict[str, set[str]] = {}
    parents: dict[str, str] = {}

    def root(name: str) -> str:
        """Each part of the team has its own, and a token of its own."""
        return root(parents[name]) if name in parents else name

    def look(event: Event) -> None:
        if not isinstance(event, Sent) or event.type not in {"Token", "Back"}:
            return
        name = event.sender
        if name not in heard:  # a root, or the first time that the token is here
            heard[name] = {parents[name]} if name in parents else set()
        heard[name] |= met[name] & heard.keys()
        wanted = {
            one: sum(
                other != parents.get(one) and len(met[other]) > 1 and one not in heard.get(other, ())
                for other in met[one]
            )
            for one in heard
            if root(one) == root(name)
        }
        assert event.content["visited"] == {one: number for one, number in wanted.items() if number}
        if event.type == "Token":
            heard[name].add(event.receiver)
            parents[event.receiver] = name

    Simulation(team, Greeter, any_schedule(chance), observer=look).search()


def test_on_a_path_the_token_names_one_robot_at_most() -> None:
    """So bytes grow as the team does, where the names of all in the tree would grow with its square."""
    path = random_on(grid(1, 300), 2, 0.0)
    lists: list[int] = []

    def look(event: Event) -> None:
        if isinstance(event, Sent) and event.type in {"Token", "Back"}:
            lists.append(len(event.content["visited"]))

    Simulation(path, Greeter, Concurrent(0), observer=look).search()
    assert len(lists) == 2 * 299
    assert max(lists) == 1


def test_greetings_come_early_in_such_runs() -> None:
    """They are kept until the robot begins."""
    chance = Random("early")
    runs = [played(random_graph(chance), chance)[1] for _ in range(40)]
    assert sum(robot.early for robots in runs for robot in robots.values()) > 40


def test_processes_build_the_same_tree() -> None:
    team = random_graph(Random("processes 1"))
    outcome = solve(team, Options(protocol="adopt", runtime=Runtime.PROCESSES, timeout=HANG_S))
    assert outcome.tree == expected(team)


# One robot alone

TEAM = graph("ABCDE", "AB BC BD CD DE")
"""B and D have three neighbours, C has two; A and E are leaves."""


agent = partial(started_robot, Greeter, TEAM)


def test_every_robot_stands_for_election() -> None:
    greeter = robot_of(Greeter, TEAM, "RC")
    assert started(greeter) == [("RB", Wave(2, "RC")), ("RD", Wave(2, "RC"))]
    assert greeter.findings == Findings()


def test_a_stronger_candidate_s_wave_goes_on_and_back_from_all_neighbours_to_who_told_it_first() -> None:
    """A weaker one's ends. Of equals, the one that is lower in the order is weaker."""
    for weaker in (Wave(1, "RA"), Wave(3, "RD")):
        greeter = agent("RC")
        assert replies(greeter, ("RB", Wave(3, "RB"))) == [("RD", Wave(3, "RB"))]
        assert replies(greeter, ("RD", weaker)) == []
        assert replies(greeter, ("RD", Wave(3, "RB"))) == [("RB", Wave(3, "RB"))]


def test_a_robot_alone_is_its_own_tree_and_says_nothing_or_without_values_ends_the_search() -> None:
    greeter = robot_of(Greeter, graph("AB", ""), "RA")
    assert started(greeter) == []
    assert (greeter.begun, greeter.decided) == (1, 1)
    assert greeter.findings.place == PseudoTreeNode(None)
    greeter = started_robot(Greeter, team_of({"A": (), "B": (1,)}, []), "RA")
    assert greeter.verdict is Verdict.NO_SOLUTION
    assert replies(greeter, ("RB", Wave(1, "RB"))) == []
    assert greeter.begun == 0


def test_who_gets_the_own_wave_back_from_all_neighbours_is_the_root_and_sends_the_token() -> None:
    greeter, own = agent("RB"), Wave(3, "RB")
    others = (("RA", Wave(1, "RA")), ("RC", Wave(2, "RC")), ("RD", Wave(3, "RD")))
    assert replies(greeter, *others) == []
    assert replies(greeter, ("RA", own), ("RC", own)) == []
    assert replies(greeter, ("RD", own)) == [("RD", Token({"RB": 2}))]


def test_the_token_comes_back_when_all_neighbours_are_in_the_tree() -> None:
    greeter = agent("RC", ("RB", Wave(3, "RB")), ("RD", Wave(3, "RD")))
    said = replies(greeter, ("RD", Token({"RB": 1, "RD": 1})))
    assert said[0] == ("RD", Back({"RC": 1}))
    assert greeter.findings.place == PseudoTreeNode("RD", ("RB",))


def test_a_robot_begins_when_all_below_it_have_their_places() -> None:
    greeter = agent("RD")
    waves = (("RB", Wave(3, "RB")), ("RC", Wave(2, "RC")), ("RE", Wave(1, "RE")))
    replies(greeter, *waves)
    assert replies(greeter, ("RB", Token({"RB": 2})), ("RC", Hello())) == [("RC", Token({"RB": 1, "RD": 1}))]
    assert replies(greeter, ("RC", Back({"RC": 1}))) == [("RE", Token({"RC": 1}))]
    assert not greeter.placed
    assert greeter.decided == 0
    said = replies(greeter, ("RE", Back({"RC": 1})))
    assert said[0] == ("RB", Back({"RC": 1}))
    assert [receiver for receiver, message in said if message == Hello()] == ["RB", "RC", "RE"]
    assert greeter.greeted == ["RC"]
    assert greeter.decided == 1
