"""The entries of a journal: a header, the events of a run, and its outcome; and the errors of journals."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import msgspec

from robochoc.journal.events import AnyEvent, Event
from robochoc.model.outcome import Outcome
from robochoc.system.errors import RobochocError

VERSION = 2
"""The version of the entries' meaning. It is increased if an entry is added or changed. Readers reject others."""
STAMPED_LATE = 1
"""The version in which the `clock` of a sent message was the one at the end of the step, and followed the decision."""
BOUNDED = 3
"""The version of journals with `Bounded` events, which are recorded only on request."""
_BITS = 63
"""Longer integers are written as texts, because integers in msgpack have at most 64 bits."""
READ = (STAMPED_LATE, VERSION, BOUNDED)
"""The versions that can be read."""


class JournalError(RobochocError, ValueError):
    """Raised if the file is not a journal, has an unknown version, or is unreadable from the start."""


class Header(Event, frozen=True, kw_only=True, tag="Journal"):
    """The header of a journal: the team, the options of the run, and the version of the format."""

    t: float = 0
    team: str
    protocol: str
    runtime: str
    seed: int
    order: str | tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET
    """The priority order, as a name or a list of robots. It is omitted for the order in the files."""
    channel: str | msgspec.UnsetType = msgspec.UNSET
    """The channel model, if any. With one, the times of the search's events are in simulated seconds."""
    message_loss: float | msgspec.UnsetType = msgspec.UNSET
    """The probability that a message is lost, if messages could be lost. Lost messages have no `Received`."""
    answer: str | msgspec.UnsetType = msgspec.UNSET
    """The rule for the answer without a proof: `final` for the last values. It is omitted for the best ones."""
    improve: float | msgspec.UnsetType = msgspec.UNSET
    """The seconds after the deadline in which answers were published: the answer may be an earlier one."""
    limit_s: float | msgspec.UnsetType = msgspec.UNSET
    """The time limit or deadline of a search in seconds. Robots in processes may not have reported all their steps."""
    version: int = VERSION


class Ended(Event, frozen=True, kw_only=True):
    """The outcome of the run. An interrupted run has no such entry."""

    t: float = 0
    outcome: Outcome
    long: dict[str, Decimal] | msgspec.UnsetType = msgspec.UNSET
    """Numbers of solutions and optima with more than 64 bits, omitted in `outcome`. Unset if there are none."""

    @classmethod
    def from_outcome(cls, outcome: Outcome) -> Ended:
        """Return the entry for an outcome."""
        long: dict[str, Decimal] = {}
        if outcome.count is not None and outcome.count.bit_length() > _BITS:
            long["count"], outcome = Decimal(outcome.count), replace(outcome, count=None)
        if outcome.optima is not None and outcome.optima.number.bit_length() > _BITS:
            long["optima"] = Decimal(outcome.optima.number)
            outcome = replace(outcome, optima=outcome.optima._replace(number=0))
        return cls(outcome=outcome, long=long or msgspec.UNSET)

    @property
    def complete_outcome(self) -> Outcome:
        """The outcome, including the numbers in `long`."""
        outcome, long = self.outcome, self.long or {}
        if "count" in long:
            outcome = replace(outcome, count=int(long["count"]))
        if "optima" in long and outcome.optima is not None:
            outcome = replace(outcome, optima=outcome.optima._replace(number=int(long["optima"])))
        return outcome


JournalEntry = AnyEvent | Header | Ended
"""An entry of a journal."""
