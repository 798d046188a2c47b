"""Maximum spanning forests that the robots build themselves, as in Boruvka's algorithm.

At first each robot is a separate tree. In a round, each tree finds the heaviest function that leads out of it, and all
trees joined by such functions become one tree; so there are at most log2(n) rounds. All robots in a tree know its root,
and send it to their neighbours (Fragment). The heaviest functions are reported up the tree (Heaviest), its root chooses
one (Choice), and robots tell their neighbours in other trees whether their common function was chosen (Merged). Exactly
one function in the new tree was chosen from both sides; the higher of its robots is the new root, and informs the whole
tree (NewRoot).

A robot continues with a round when it has all messages for it: the messages from one robot arrive in the order in which
they were sent, and wait until then. No two functions are equally heavy, because ties are broken by the robots'
positions in the order. (Boruvka 1926; with messages: Gallager, Humblet, Spira: "A distributed algorithm for
minimum-weight spanning trees", ACM TOPLAS 5(1), 1983, which needs no common rounds, and fewer messages.)
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LocalProblem

Ends = tuple[str, str]
"""The two robots of a function, the higher first."""


class Fragment(Message, frozen=True):
    """The root of the tree that the sender belongs to."""

    root: str

    act = Act(Performative.INFORM, "the receiver learns whether both are in the same part of the forest")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        return f"my tree is that of {self.root}"


class Heaviest(Message, frozen=True):
    """The heaviest function that leads out of the sender's branch, and its robots; None if there is none."""

    weight: float | None
    ends: Ends | None

    act = Act(Performative.PROPOSE, "a function by which the tree may be joined with another one")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        if self.ends is None or self.weight is None:
            return "nothing leads out of my branch"
        return f"the heaviest function out of my branch is that of {' and '.join(self.ends)}: {cost_text(self.weight)}"


class Choice(Message, frozen=True):
    """The robots of the function that joins this tree with another; None if there is none and the tree is complete."""

    ends: Ends | None

    act = Act(Performative.INFORM, "the receiver learns where the tree grows")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        if self.ends is None:
            return "our tree is done"
        return f"our tree is joined by the function of {' and '.join(self.ends)}"


class Merged(Message, frozen=True):
    """True if the sender's tree is joined with the receiver's tree by their common function."""

    joined: bool

    act = Act(Performative.INFORM, "the receiver learns whether their function is in the tree")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"my tree is {'' if self.joined else 'not '}joined with that of {words.receiver} here"


class NewRoot(Message, frozen=True):
    """The root of the tree that results when several trees are joined; the sender is the receiver's parent."""

    root: str

    act = Act(Performative.INFORM, "the receiver learns its parent")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        return f"we are in the tree of {self.root} now"


Heaviness = tuple[float, int, int]
"""A weight, and the robots' ranks, which break ties."""


class SpanningProtocol(Protocol):
    """One agent that first builds a maximum spanning forest with the others.

    `weights` are the weights of the functions shared with neighbours, known on both sides, when `start_spanning` is
    called. `parent` (None: a root) and `children` are known when `start_in_tree` is called.
    """

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.weights: dict[str, float] = {}
        self.parent: str | None = None
        self.joined: list[str] = []
        """The neighbours in the tree."""
        self.root = problem.agent
        self.stage: Callable[[], bool] | None = None
        """The next step of the construction; it returns False while messages for it are missing."""
        self._waiting: dict[str, list[Message]] = {name: [] for name in problem.neighbours}
        self._outer: list[str] = []
        self._own_choice: str | None = None

    @abstractmethod
    def start_in_tree(self) -> None:
        """Continue; the tree is complete."""

    @property
    def children(self) -> list[str]:
        """The neighbours in the tree, without the parent."""
        return [name for name in self.joined if name != self.parent]

    def receive(self, sender: str, message: Message) -> None:
        """Store the message for its stage."""
        self._waiting[sender].append(message)

    def settle(self) -> None:
        """Execute all stages whose messages have arrived."""
        while self.verdict is None and self.stage is not None and self.stage():
            pass

    def next_messages(self, names: Iterable[str]) -> dict[str, Message] | None:
        """Remove and return the next message from each of `names`; None if one is missing."""
        senders = list(names)
        if not all(self._waiting[name] for name in senders):
            return None
        return {name: self._waiting[name].pop(0) for name in senders}

    def start_spanning(self) -> None:
        """Start the first round."""
        self._outer = list(self.weights)
        self._next_round()

    def _next_round(self) -> None:
        for name in self._outer:
            self.send(name, Fragment(self.root))
        self.stage = self._compare

    def _compare(self) -> bool:
        """Find the functions that lead out of the tree."""
        messages = self.next_messages(self._outer)
        if messages is None:
            return False
        self._outer = [name for name, one in messages.items() if isinstance(one, Fragment) and one.root != self.root]
        self.stage = self._report
        return True

    def _report(self) -> bool:
        """Report the heaviest function that leads out of the branch; at the root, choose it."""
        messages = self.next_messages(self.children)
        if messages is None:
            return False
        found = {self._ends(name): self._heaviness(self._ends(name), self.weights[name]) for name in self._outer}
        for report in messages.values():
            if isinstance(report, Heaviest) and report.ends is not None and report.weight is not None:
                found[report.ends] = self._heaviness(report.ends, report.weight)
        best = max(found, key=found.__getitem__) if found else None
        if self.parent is None:
            self._choose(best)
        else:
            self.send(self.parent, Heaviest(found[best][0] if best else None, best))
            self.stage = self._receive_choice
        return True

    def _receive_choice(self) -> bool:
        messages = self.next_messages([] if self.parent is None else [self.parent])
        if messages is None:
            return False
        for message in messages.values():
            self._choose(message.ends if isinstance(message, Choice) else None)
        return True

    def _choose(self, ends: Ends | None) -> None:
        """Send the children the choice, and neighbours in other trees whether it is their function."""
        for child in self.children:
            self.send(child, Choice(ends))
        if ends is None:
            self.stage = None
            self.start_in_tree()
            return
        self._own_choice = None
        for name in self._outer:
            if self._ends(name) == ends:
                self._own_choice = name
            self.send(name, Merged(name == self._own_choice))
        self.stage = self._join

    def _join(self) -> bool:
        """Add the functions chosen from either side to the tree."""
        messages = self.next_messages(self._outer)
        if messages is None:
            return False
        chosen = [name for name, one in messages.items() if isinstance(one, Merged) and one.joined]
        new = [name for name in self._outer if name in chosen or name == self._own_choice]
        self._outer = [name for name in self._outer if name not in new]
        self.joined += new
        if self._own_choice in chosen and self._ends(self._own_choice)[0] == self.problem.agent:
            self._set_root(None, self.problem.agent)
        else:
            self.stage = self._receive_root
        return True

    def _receive_root(self) -> bool:
        for name in self.joined:
            waiting = self._waiting[name]
            if waiting and isinstance(waiting[0], NewRoot):
                message = waiting.pop(0)
                assert isinstance(message, NewRoot)  # noqa: S101 - for mypy
                self._set_root(name, message.root)
                return True
        return False

    def _set_root(self, parent: str | None, root: str) -> None:
        self.parent, self.root = parent, root
        for child in self.children:
            self.send(child, NewRoot(root))
        self._next_round()

    def _ends(self, name: str | None) -> Ends:
        one, other = sorted((self.problem.agent, name or ""), key=self.order.rank.__getitem__)
        return one, other

    def _heaviness(self, ends: Ends, weight: float) -> Heaviness:
        return weight, -self.order.rank[ends[0]], -self.order.rank[ends[1]]
