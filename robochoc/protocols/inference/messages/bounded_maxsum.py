"""The messages of bounded Max-Sum (see `bounded_maxsum.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text, costs_text
from robochoc.protocols import acts

Ends = tuple[str, str]
"""The two robots of a function, the higher first."""


class Dependency(Message, frozen=True):
    """The sender's function of both robots: its `weight`, and what stays for the receiver if it is cut.

    `weight` is None where there is no function. `rest` is empty where the sender keeps the rest.
    """

    weight: float | None
    rest: list[float]

    act = Act(Performative.INFORM, "the receiver comes to know how much the function binds both")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        if self.weight is None:
            return f"no function joins me and {words.receiver}"
        return f"without our function, costs are at most {cost_text(self.weight)} off"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Fragment(Message, frozen=True):
    """The root of the sender's part of the forest."""

    root: str

    act = Act(Performative.INFORM, "the receiver comes to know whether both are in one part of the forest")

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        """Return what the sender says."""
        return f"my tree is that of {self.root}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Heaviest(Message, frozen=True):
    """The heaviest function that leads out of the sender's branch, and its robots. None: no function does."""

    weight: float | None
    ends: Ends | None

    act = Act(Performative.PROPOSE, "the tree is to be joined with another one there")

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        """Return what the sender says."""
        if self.ends is None or self.weight is None:
            return "nothing leads out of my branch"
        return f"the heaviest function out of my branch is that of {' and '.join(self.ends)}: {cost_text(self.weight)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Choice(Message, frozen=True):
    """The robots of the function that joins this tree with another one. None: there is no other; the tree is done."""

    ends: Ends | None

    act = Act(Performative.INFORM, "the receiver comes to know where the tree grows")

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        """Return what the sender says."""
        if self.ends is None:
            return "our tree is done"
        return f"our tree is joined by the function of {' and '.join(self.ends)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Merged(Message, frozen=True):
    """Whether the sender's tree is joined with the receiver's by their function."""

    joined: bool

    act = Act(Performative.INFORM, "the receiver comes to know whether their function is in the tree")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"my tree is {'' if self.joined else 'not '}joined with that of {words.receiver} here"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class NewRoot(Message, frozen=True):
    """The root of the tree that several have become; the sender is the receiver's parent."""

    root: str

    act = Act(Performative.INFORM, "the receiver comes to know its parent")

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        """Return what the sender says."""
        return f"we are in the tree of {self.root} now"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Branch(Message, frozen=True):
    """A lower bound on the cost of the sender's branch.

    `costs` are of the receiver's values, if the sender holds their function (R), and of its own otherwise (Q). `cut`
    is the weight of all that was cut there, `most` what all could add up to.
    """

    costs: list[float]
    cut: float
    most: float

    act = acts.TELL_BOUNDS

    def in_words(self, words: Wording) -> str:  # noqa: ARG002 - the interface
        """Return what the sender says."""
        return f"my branch costs {costs_text(self.costs)}, and up to {cost_text(self.cut)} more"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing by itself, as constraints are cut."""
        return NOTHING


class Assign(Message, frozen=True):
    """The receiver's value: the best for the value of the sender, who holds their function."""

    value: message.Value

    act = Act(Performative.REQUEST, "the receiver is to take the value that it is given")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"take {self.value} as your value, {words.receiver}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
