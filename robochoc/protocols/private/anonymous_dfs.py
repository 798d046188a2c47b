"""Pseudo-trees that robots build without names: messages contain no names of robots, and no numbers of neighbours.

As in `shared/dfs.py` a root is elected by waves of all candidates (the echo algorithm with extinction; Tel,
"Introduction to Distributed Algorithms", 2nd edition, 2000, Section 7.2), and a token visits all robots depth first
from there. The differences protect privacy: a candidate has a random score, which reveals neither its name nor its
degree; the token contains no names, so it bounces off visited robots (Cheung, IEEE TSE 9(4), 1983), which takes two
more messages for each edge outside the tree; and a robot sends it to its neighbours in a random order.

A robot that receives the token again is above the sender: if it were below, it would have sent the token to the sender
earlier.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from robochoc.model.outcome import Verdict
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.dfs import TreeProtocol
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem


class Wave(Message, frozen=True):
    """An election wave of the candidate with this random `score`; it becomes the root if its wave returns."""

    score: bytes

    act = Act(Performative.PROPOSE, "a candidate for the root, for the receiver to prefer or to drop")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"a robot whose score begins with {self.score[:2].hex()} wants to be the root"


class Token(Message, frozen=True):
    """The token of the depth-first search; a receiver that it has not visited becomes the sender's child."""

    act = Act(Performative.REQUEST, "the receiver must continue building the tree")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "if you are not in the tree yet, you are my child"


class Bounce(Message, frozen=True):
    """The immediate return of the token: the sender is already in the tree, above the receiver."""

    act = Act(Performative.REFUSE, "the sender is already in the tree")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "I am in the tree, above you"


class Back(Message, frozen=True):
    """The token on its way back: all robots below the sender are in the tree."""

    act = Act(Performative.INFORM, "the request of `Token` is done")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "all below me are in the tree"


AnonymousTreeMessage = Wave | Token | Bounce | Back
"""The messages that every `AnonymousTreeProtocol` receives besides its own."""


SCORE = 16
"""The number of bytes of a score: two robots have the same score once in 2^128 pairs."""


class AnonymousTreeProtocol(TreeProtocol):
    """One agent that finds its position in a pseudo-tree without names, and then runs a protocol on the tree."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self._score = b""
        self._from: str | None = None
        self._returned: set[str] = set()
        self._visited = False
        self._to_visit: list[str] = []

    @abstractmethod
    def start_in_tree(self) -> None:
        """Start the search; the position in the tree is known."""

    def leave_tree(self) -> None:
        """Forget the position in the tree, but not the election: the next tree has another root."""
        self.parent = None
        self.pseudo_parents = self.children = self.pseudo_children = ()
        self.placed = False
        self._met = set()
        self._visited = False
        self._to_visit = []

    def start(self) -> None:
        """Start this robot's election wave; a robot with an empty domain ends the search."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.problem.neighbours:
            self.enter(None)
            self.settle()
        else:
            self._score = self.secret(8 * SCORE).to_bytes(SCORE, "little")
            for name in self.problem.neighbours:
                self.send(name, Wave(self._score))

    def receive(self, sender: str, message: Message) -> None:
        """Process the messages that build the tree; store messages of the search until `start_in_tree`."""
        if self.verdict is not None:
            return
        match message:
            case Wave(score):
                self._process_wave(sender, score)
            case Token():
                self._process_token(sender)
            case Bounce():
                self._met.add(sender)
                self.pseudo_parents = self._sorted((*self.pseudo_parents, sender))
                self._send_token()
            case Back():
                self._send_token()
            case _ if self.placed:
                self.handle(sender, message)
            case _:
                self._early.append((sender, message))

    def _process_wave(self, sender: str, score: bytes) -> None:
        """Prefer the candidate with the higher score; return its wave once it has arrived from all neighbours."""
        if len(score) != SCORE:
            raise ValueError(f"{sender} sent a score of {len(score)} bytes; it must have {SCORE}")
        if score > self._score:
            self._score, self._from, self._returned = score, sender, set()
            for name in self.problem.neighbours:
                if name != sender:
                    self.send(name, Wave(score))
        if score != self._score:
            return
        self._returned.add(sender)
        if len(self._returned) < len(self.problem.neighbours):
            return
        if self._from is None:
            self.enter(None)
        else:
            self.send(self._from, Wave(score))

    def _process_token(self, sender: str) -> None:
        if not self._visited:
            self.enter(sender)
            return
        self._met.add(sender)  # it is below, as a pseudo-child
        self.send(sender, Bounce())

    def enter(self, parent: str | None) -> None:
        """Process the first visit of the token; the root starts with a visit from no robot."""
        self._visited = True
        self.parent = parent
        self._met.update([] if parent is None else [parent])
        self._to_visit = shuffled([name for name in self.problem.neighbours if name != parent], self.secret)
        self._send_token()

    def _send_token(self) -> None:
        """Send the token to a neighbour that may not be in the tree yet, or back if there is none."""
        while self._to_visit and self._to_visit[-1] in self._met:
            self._to_visit.pop()
        if self._to_visit:
            child = self._to_visit.pop()
            self._met.add(child)
            self.children = (*self.children, child)
            self.send(child, Token())
            return
        self._complete_subtree()

    def _complete_subtree(self) -> None:
        """Set the position in the tree, and start the search: the whole subtree is in the tree."""
        above = {*self.ancestors}
        self.children = self._sorted(name for name in self.children if name not in above)
        known = above | {*self.children}
        self.pseudo_children = self._sorted(name for name in self.problem.neighbours if name not in known)
        if self.parent is not None:
            self.send(self.parent, Back())
        self.placed = True
        self.start_in_tree()
        early: Sequence[tuple[str, Message]]
        early, self._early = self._early, []
        for sender, message in early:
            self.receive(sender, message)
