"""Pseudo-trees that the robots build themselves: leader election, then a distributed depth-first search.

Each connected component elects the robot with the most neighbours: waves of all candidates spread, and only the
strongest candidate's wave survives (the echo algorithm with extinction; Tel, "Introduction to Distributed Algorithms",
2nd edition, 2000, Section 7.2). From there a token visits all robots depth first (Cheung, "Graph traversal techniques
and the maximum flow problem in distributed computation", IEEE TSE 9(4), 1983). In that paper the token bounces off
visited robots, which takes two more messages for each edge outside the tree. Here the token lists the visited robots
and is never sent to a visited robot, which takes two messages for each robot except the root (as in Makki, Havas:
"Distributed algorithms for depth-first search", IPL 60, 1996). The token lists a robot only until all neighbours of
that robot know of the visit; with each name, it contains the number of neighbours that do not know yet. So on a path
the token lists one robot at a time, and on a tree only the robots on one branch. A robot sends the token to its
unvisited neighbour with the most neighbours. Ties go to the robot with higher priority.

Neighbours are then on the same branch, as in every depth-first search of an undirected graph. All robots in an n-ary
constraint are on the same branch, too, because they are all neighbours of each other. The cost is 2 messages for each
robot for the token, and at least 2 for each edge for the election.
"""

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence

from robochoc.model.outcome import PseudoTreeNode, Verdict
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.shared.messages.dfs import Back, Token, Wave
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class TreeProtocol(Protocol):
    """One agent that first finds its position in a pseudo-tree, and then runs a protocol on the tree.

    `parent` (None: a root), `pseudo_parents`, `children` and `pseudo_children` are known, in priority order, when
    `start_in_tree` is called. From then on `handle` is called for each message and `decide` for each packet.
    Earlier messages are stored until then. Children may start before their parents, but never after them.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.parent: str | None = None
        self.pseudo_parents: tuple[str, ...] = ()
        self.children: tuple[str, ...] = ()
        self.pseudo_children: tuple[str, ...] = ()
        self.placed = False
        """True if this robot, and all robots below it, have their positions in the tree."""
        self._election = _Election(problem.agent, problem.neighbours, order)
        self._met: set[str] = set()
        """The neighbours that this robot knows to be in the tree."""
        self._early: list[tuple[str, Message]] = []

    def leave_tree(self) -> None:
        """Forget the position in the tree; `start` builds a new tree, with the present neighbours and order."""
        self.parent = None
        self.pseudo_parents = self.children = self.pseudo_children = ()
        self.placed = False
        self._election = _Election(self.problem.agent, self.problem.neighbours, self.order)
        self._met = set()
        self._early = []

    @abstractmethod
    def start_in_tree(self) -> None:
        """Start the search; the position in the tree is known."""

    @abstractmethod
    def handle(self, sender: str, message: Message) -> None:
        """Process one message of the search."""

    def decide(self) -> None:
        """Decide; called after all waiting messages have been processed."""

    def start(self) -> None:
        """Start this robot's election wave; if the domain is empty, end the search."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.problem.neighbours:
            self._visit(None, {})
            self.settle()
        else:
            self._propagate(self._election.start())

    def receive(self, sender: str, message: Message) -> None:
        """Process the messages that build the tree; store messages of the search until `start_in_tree`."""
        if self.verdict is not None:
            return
        match message:
            case Wave():
                self._propagate(self._election.receive(sender, message))
                if self._election.won:
                    self._visit(None, {})
            case Token(visited):
                self._visit(sender, visited)
            case Back(visited):
                self._pass_token(self._store_visited(visited))
            case _ if self.placed:
                self.handle(sender, message)
            case _:
                self._early.append((sender, message))

    def settle(self) -> None:
        """Call `decide` if the position in the tree is known."""
        if self.placed and self.verdict is None:
            self.decide()

    @property
    def ancestors(self) -> tuple[str, ...]:
        """The neighbours above: the parent and the pseudo-parents."""
        return self.pseudo_parents if self.parent is None else (self.parent, *self.pseudo_parents)

    @property
    def descendants(self) -> tuple[str, ...]:
        """The neighbours below: the children and the pseudo-children."""
        return (*self.children, *self.pseudo_children)

    @property
    def findings(self) -> Findings:
        """This robot's position in the tree."""
        return Findings(place=PseudoTreeNode(self.parent, self.pseudo_parents) if self.placed else None)

    def _propagate(self, waves: Sequence[tuple[str, Wave]]) -> None:
        for receiver, wave in waves:
            self.send(receiver, wave)

    def _visit(self, parent: str | None, visited: Mapping[str, int]) -> None:
        """Process the first visit of the token: neighbours that the token has already visited are above this robot.

        A robot whose only neighbour is its parent needs no list, and no other robot needs to know that it was visited.
        """
        self.parent = parent
        neighbours = self.problem.neighbours
        left = visited if len(neighbours) == 1 else self._store_visited(visited)
        self._met.update([] if parent is None else [parent])
        self.pseudo_parents = self._sorted(self._met - {parent})
        unaware = sum(name != parent and self._election.degree(name) > 1 for name in neighbours)
        self._pass_token({**left, self.problem.agent: unaware} if unaware else left)

    def _store_visited(self, visited: Mapping[str, int]) -> Mapping[str, int]:
        """Record which neighbours were `visited`; return the visited robots that some neighbour does not know yet."""
        new = [name for name in self.problem.neighbours if name in visited and name not in self._met]
        if not new:
            return visited
        self._met.update(new)
        counts = {**visited, **{name: visited[name] - 1 for name in new}}
        return {name: unaware for name, unaware in counts.items() if unaware}

    def _pass_token(self, visited: Mapping[str, int]) -> None:
        """Send the token to an unvisited neighbour, or back to the parent if all neighbours are in the tree."""
        left = [name for name in self.problem.neighbours if name not in self._met]
        if left:
            child = max(left, key=self._election.strength)
            self._met.add(child)
            self.children = self._sorted((*self.children, child))
            self.send(child, Token(dict(visited)))
            return
        known = {*self.ancestors, *self.children}
        self.pseudo_children = self._sorted(name for name in self.problem.neighbours if name not in known)
        if self.parent is not None:
            self.send(self.parent, Back(dict(visited)))
        self.placed = True
        self.start_in_tree()
        early, self._early = self._early, []
        for sender, message in early:
            self.receive(sender, message)

    def _sorted(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(sorted(names, key=self.order.rank.__getitem__))


class _Election:
    """One agent's part in the election: the strongest known `candidate`, and the neighbour from which its wave came.

    `_arrived` are the neighbours from which that candidate's wave has arrived. When it has arrived from all neighbours,
    the wave is returned.
    """

    def __init__(self, agent: str, neighbours: Sequence[str], order: PriorityOrder) -> None:
        self._neighbours = neighbours
        self._order = order
        self._degrees = {agent: len(neighbours)}
        self._agent = self._candidate = agent
        self._from: str | None = None
        self._arrived: set[str] = set()
        self.won = False

    def strength(self, name: str) -> tuple[int, int]:
        """Return a key that orders candidates: more neighbours first, then higher priority."""
        return self._degrees[name], -self._order.rank[name]

    def degree(self, name: str) -> int:
        """Return the number of neighbours of a neighbour."""
        return self._degrees[name]

    def start(self) -> list[tuple[str, Wave]]:
        """Return this robot's wave for all neighbours."""
        return [(name, self._wave) for name in self._neighbours]

    def receive(self, sender: str, wave: Wave) -> list[tuple[str, Wave]]:
        """Return the messages that answer a wave; the wave of a weaker candidate gets no answer."""
        self._degrees[wave.candidate] = wave.neighbours
        answers: list[tuple[str, Wave]] = []
        if self.strength(wave.candidate) > self.strength(self._candidate):
            self._candidate, self._from, self._arrived = wave.candidate, sender, set()
            answers = [(name, self._wave) for name in self._neighbours if name != sender]
        if wave.candidate != self._candidate:
            return answers
        self._arrived.add(sender)
        if len(self._arrived) == len(self._neighbours):
            if self._from is None:
                self.won = True
            else:
                answers.append((self._from, self._wave))
        return answers

    @property
    def _wave(self) -> Wave:
        return Wave(self._degrees[self._candidate], self._candidate)
