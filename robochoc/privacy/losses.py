"""Measures of privacy loss: the share of a subject's possible problems that an observer can exclude.

They are valuations of possible states (Maheswaran, Pearce, Bowring, Varakantham, Tambe: "Privacy loss in distributed
constraint reasoning: a quantitative framework for analysis and its applications", JAAMAS 13, 2006). A subject's states
are all combinations of its secrets' possible values. With S initial states and P states that are still possible for the
observer, privacy is (P - 1) / (S - 1) by LinearTS, and log P / log S by EntropyTS. The third measure is the share of
the secrets that are not known exactly. Loss is 1 - privacy: 0 if nothing is excluded, 1 if everything is known.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from enum import StrEnum

from robochoc.system.lazy_dataclass import dataclass


class Kind(StrEnum):
    """The kinds of secrets."""

    DECISION = "decision"
    DOMAIN = "domain"
    CONSTRAINTS = "constraints"


class Measure(StrEnum):
    """The measures of privacy loss."""

    LINEAR = "linear"
    ENTROPY = "entropy"
    KNOWN = "known"


@dataclass(frozen=True)
class Loss:
    """The loss of one kind of secrets of `subject` to `observer`.

    Attributes:
        observer: The robot that received the messages.
        subject: The robot whose secrets the messages concern.
        kind: The kind of secrets.
        secrets: The number of secrets of this kind.
        linear: The loss by LinearTS; None if the losses are unknown.
        entropy: The loss by EntropyTS.
        known: The share of the secrets that are known exactly.
    """

    observer: str
    subject: str
    kind: Kind
    secrets: int
    linear: float | None
    entropy: float | None
    known: float | None

    def by(self, measure: Measure) -> float | None:
        """Return the loss by `measure`; None if it is unknown."""
        match measure:
            case Measure.LINEAR:
                return self.linear
            case Measure.ENTROPY:
                return self.entropy
            case Measure.KNOWN:
                return self.known


@dataclass(frozen=True)
class PrivacyReport:
    """The privacy loss in one run.

    Attributes:
        team: The name of the team.
        protocol: The name of the run's protocol, or of its class if it has none.
        run: The number of the run in the journal, from 1.
        runs: The number of runs in the journal.
        robots: All robots, the highest priority first.
        losses: The losses of all pairs of an observer and a subject with secrets.
        without_rule: The types of received messages without a rule.
        undecided: The reason why the losses do not include decisions; empty if they do.
    """

    team: str
    protocol: str
    run: int
    runs: int
    robots: tuple[str, ...]
    losses: tuple[Loss, ...]
    without_rule: tuple[str, ...]
    undecided: str = ""

    def system_loss(self, kind: Kind, measure: Measure) -> float | None:
        """Return the mean loss over all pairs of robots; None if there are no losses, or if one of them is unknown."""
        return mean([loss.by(measure) for loss in self.losses if loss.kind is kind])

    def loss_of(self, subject: str, kind: Kind, measure: Measure) -> float | None:
        """Return the mean loss of a subject to all observers."""
        return mean([loss.by(measure) for loss in self.losses if loss.kind is kind and loss.subject == subject])

    def kinds(self) -> list[Kind]:
        """Return the kinds of secrets in the run."""
        return [kind for kind in Kind if any(loss.kind is kind for loss in self.losses)]


def mean(losses: Sequence[float | None]) -> float | None:
    """Return the mean of losses; None if there are none, or if one of them is unknown."""
    known = [loss for loss in losses if loss is not None]
    return math.fsum(known) / len(known) if known and len(known) == len(losses) else None


def loss_between(
    observer: str, subject: str, kind: Kind, numbers: Sequence[tuple[int, int]], *, known: bool
) -> Loss | None:
    """Return the loss; None if the subject has no secrets.

    Args:
        observer: The robot that received the messages.
        subject: The robot whose secrets the messages concern.
        kind: The kind of secrets.
        numbers: For each secret, the number of its states, and the number of states that are still possible.
        known: True if the loss is known.
    """
    hidden = [(states, possible) for states, possible in numbers if states > 1]
    if not hidden:
        return None
    if not known:
        return Loss(observer, subject, kind, len(hidden), None, None, None)
    states = _product(before for before, _ in hidden)
    possible = _product(after for _, after in hidden)
    before = math.fsum(math.log(number) for number, _ in hidden)
    after = math.fsum(math.log(number) for _, number in hidden)
    exact = sum(number == 1 for _, number in hidden)
    return Loss(
        observer=observer,
        subject=subject,
        kind=kind,
        secrets=len(hidden),
        linear=(states - possible) / (states - 1),
        entropy=1 - after / before,
        known=exact / len(hidden),
    )


def _product(numbers: Iterable[int]) -> int:
    """Return the product of many numbers, most of which are equal: powers take less time than single products."""
    return math.prod(number**count for number, count in Counter(numbers).items())
