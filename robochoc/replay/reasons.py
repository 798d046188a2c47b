"""The reasons for a robot's new value, backtracking, or conclusion of the search, as text, one line each."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from robochoc.journal.events import Concluded, Sent
from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.nogood import NogoodStore
from robochoc.replay.inspection import ALWAYS, MOST_VALUES, Inspector, safely
from robochoc.replay.steps import RecordedStep
from robochoc.replay.value_text import as_value
from robochoc.system.compiled_core import attributes_of

MOST_REASONS = 8
MOST_BACKTRACKS = 3
"""The maximum number of backtracks shown for a step. A robot may backtrack repeatedly."""
MOST_TOGETHER = 3
"""The maximum number of values listed for a common reason."""

_CONCLUDED = {
    Verdict.NO_SOLUTION: "that there is no solution",
    Verdict.OPTIMAL: "that no solution is better than the best one known",
    Verdict.SOLUTION: "that a solution is found",
}


class _DeadEnd(NamedTuple):
    """A moment in which no value remains: the reasons that exclude the values, and the message sent then."""

    ruled_out: list[str]
    kind: str
    said: str
    receivers: list[str]

    def lines(self) -> list[str]:
        more = len(self.receivers) - MOST_REASONS
        whom = ", ".join([*self.receivers[:MOST_REASONS], *([f"{more:,} more"] if more > 0 else [])])
        words = f"no value was left, and it said {self.kind} to {whom}{f': {self.said}' if self.said else ''}"
        return [*self.ruled_out, words]


class Reasons:
    """Explains a robot's changes: inspects the robot before a step, at each message it sends, and after the step."""

    def __init__(self, inspector: Inspector, protocol: Protocol) -> None:
        self._inspector = inspector
        self._protocol = protocol
        self._value = protocol.value
        self._text = safely(lambda: self._value_text(protocol.value), None)
        self._dead_ends: list[_DeadEnd] = []
        self._answered: set[str] = set()
        """The robots to which the robot sends its value."""

    def record_sent(self, receiver: str, message: Message) -> None:
        """Record a message that the robot sends; at a dead end, also the reasons that exclude the values."""
        kind = type(message).__name__
        if not message.backtracks:
            if self._value is not None and as_value(getattr(message, "value", None)) is not None:
                self._answered.add(receiver)
            return
        if self._store() is not None and self._protocol.value is not None:
            return  # the message excludes a value of another robot
        ruled_out = safely(self._ruled_out, [])
        if self._dead_ends and self._dead_ends[-1].ruled_out == ruled_out:
            self._dead_ends[-1].receivers.append(receiver)  # AWC sends a nogood to all robots in it
        elif len(self._dead_ends) <= MOST_BACKTRACKS:
            said = safely(lambda: self._inspector.message_text(self._inspector.agent, message, receiver), "")
            self._dead_ends.append(_DeadEnd(ruled_out, kind, said, [receiver]))

    def lines(self, received: Sequence[tuple[Sent, Message]], step: RecordedStep) -> list[str]:
        """Return the reasons for a changed value, a backtrack, or a conclusion of the search; otherwise empty."""
        concluded = [event.verdict for event in step.done if isinstance(event, Concluded)]
        if self._protocol.value == self._value and not concluded and not self._dead_ends:
            return self._repeated_value_lines(received)
        lines = [line for dead_end in self._dead_ends[:MOST_BACKTRACKS] for line in dead_end.lines()]
        if len(self._dead_ends) > MOST_BACKTRACKS:
            lines.append("and so on, until a value was left")
        hopeless = bool(concluded) and concluded[0] == str(Verdict.NO_SOLUTION) and self._is_hopeless()
        if hopeless:
            lines += self._ruled_out()
        lines = lines or self._reason_against_previous(received) or self._received_lines(received)
        if self._protocol.value != self._value or (self._dead_ends and self._value is not None):
            lines.append(self._value_line())
        return [*lines, *(self._conclusion_line(verdict, hopeless=hopeless) for verdict in concluded)]

    # Excluded values

    def _store(self) -> NogoodStore | None:
        store = attributes_of(self._protocol).get("store")
        return store if isinstance(store, NogoodStore) else None

    def _ruled_out(self) -> list[str]:
        """Return the reasons that exclude values, each with the values it excludes."""
        count = len(self._protocol.problem.values)
        by_reason: dict[str, list[str]] = {}
        for index in range(min(count, MOST_VALUES)):
            reason = self._inspector.against(self._protocol, index)
            if reason is not None:
                by_reason.setdefault(reason, []).append(self._inspector.own_value(self._protocol, index))
        lines = [f"{_together(values)} ruled out{_by(reason)}" for reason, values in by_reason.items()]
        shown = lines[:MOST_REASONS]
        rest = count - sum(map(len, list(by_reason.values())[:MOST_REASONS]))
        cut = count > MOST_VALUES or len(lines) > len(shown)
        return [*shown, f"and {rest:,} more values"] if cut and rest else shown

    def _reason_against_previous(self, received: Sequence[tuple[Sent, Message]]) -> list[str]:
        """Return the reason that excludes the previous value, and the robot's message; empty if unknown."""
        protocol, old = self._protocol, self._value
        if old is None or self._text is None or old >= len(protocol.problem.values):
            return []
        ruling = self._inspector.ruling(protocol, old)
        if ruling is None:
            return []
        text, robots = ruling
        own = protocol.problem.values[old]
        told = _last([(sent, message) for sent, message in received if _is_about(message, sent.sender, robots, own)])
        sources = "; ".join(self._message_line(sent, message) for sent, message in told[:MOST_REASONS])
        return [f"{self._text} was ruled out{_by(text)}{f' ({sources})' if sources else ''}"]

    def _received_lines(self, received: Sequence[tuple[Sent, Message]]) -> list[str]:
        more = len(received) - MOST_REASONS
        shown = [self._message_line(sent, message) for sent, message in received[:MOST_REASONS]]
        return [*shown, *([f"and {more:,} more messages"] if more > 0 else [])]

    def _message_line(self, sent: Sent, message: Message) -> str:
        said = self._inspector.message_text(sent.sender, message)
        return f"{sent.sender} said {sent.type}{f': {said}' if said else ''}"

    def _repeated_value_lines(self, received: Sequence[tuple[Sent, Message]]) -> list[str]:
        """Return why the robot sends its unchanged value: as answers to outdated nogoods and to requests of values."""
        lines = []
        for sent, message in received:
            if sent.sender not in self._answered:
                continue
            if hasattr(message, "lhs") and self._store() is not None and not (self._text or "").startswith("withdraws"):
                lines.append(
                    f"{self._message_line(sent, message)}; this nogood is outdated, and {sent.sender} forgot "
                    f"{self._text} when it sent the nogood, so this robot sends {self._text} again"
                )
            elif not message.__struct_fields__:
                lines.append(f"{sent.sender} asked for this robot's value ({sent.type})")
        return lines[:MOST_REASONS]

    # The result

    def _value_line(self) -> str:
        """Return a sentence on the value after the step, and on the values that the robot expects to change."""
        words = self._value_words()
        robots = [robot for dead_end in self._dead_ends for robot in dead_end.receivers]
        left = [robot for robot in dict.fromkeys(robots) if self._inspector.has_forgotten(self._protocol, robot)]
        if self._protocol.value is None or not left:
            return f"it {words}"
        change = "will change its value" if len(left) == 1 else "will change their values"
        return f"it assumes that {_listed(left)} {change}, and {words}"

    def _value_words(self) -> str:
        index = self._protocol.value
        if index is None:
            return "has no value now"
        first = safely(lambda: self._is_first(index), False)
        text = self._value_text(index) or ""
        if text.startswith("withdraws"):
            return text
        verb = "keeps" if index == self._value else "takes"
        return f"{verb} {text}{', the first value that nothing rules out' if first else ''}"

    def _is_first(self, index: int) -> bool:
        """Return whether all earlier values are ruled out; False if values have costs."""
        protocol, store = self._protocol, self._store()
        if protocol.traits.costs:
            return False
        if store is not None:
            return store[index] is None and all(store[place] is not None for place in range(index))
        if index >= MOST_VALUES:
            return False
        against = [self._inspector.against(protocol, place) is not None for place in range(index + 1)]
        return all(against[:-1]) and not against[-1]

    def _is_hopeless(self) -> bool:
        """Return whether all own values are ruled out whatever the values of other robots are."""
        store = self._store()
        if store is None:
            return False
        return all(store[index] is not None for index in range(len(self._protocol.problem.values))) and not any(store)

    def _conclusion_line(self, verdict: str, *, hopeless: bool) -> str:
        words = next((words for known, words in _CONCLUDED.items() if str(known) == verdict), f"the search: {verdict}")
        return f"it concluded {words}{': no value is left, whatever the others take' if hopeless else ''}"

    def _value_text(self, index: int | None) -> str | None:
        return None if index is None else self._inspector.own_value(self._protocol, index)


def _by(reason: str) -> str:
    return f"{reason.removeprefix('what holds')}" if reason == ALWAYS else f" by: {reason}"


def _last(received: Sequence[tuple[Sent, Message]]) -> list[tuple[Sent, Message]]:
    """Return, from one packet, each robot's last message about itself, and all nogoods."""
    latest = {sent.sender: place for place, (sent, message) in enumerate(received) if not hasattr(message, "lhs")}
    return [pair for place, pair in enumerate(received) if hasattr(pair[1], "lhs") or latest[pair[0].sender] == place]


def _together(values: Sequence[str]) -> str:
    """Return values as text, joined, with `was` or `were`."""
    return f"{_listed(values)} {'was' if len(values) == 1 else 'were'}"


def _listed(values: Sequence[str]) -> str:
    if len(values) == 1:
        return values[0]
    more = len(values) - MOST_TOGETHER
    shown = [*values[:MOST_TOGETHER], *([f"{more:,} more"] if more > 0 else [])]
    return f"{', '.join(shown[:-1])} and {shown[-1]}"


def _is_about(message: Message, sender: str, robots: Collection[str], own: Sequence[int | None]) -> bool:
    """Return whether `message` is about the values of `robots`, which rule out the value `own`."""
    lhs = getattr(message, "lhs", None)
    if lhs is None:
        return sender in robots
    value = as_value(getattr(message, "value", None))
    return {*lhs} <= {*robots} and (value is None or len(value) != len(own) or _agree(value, own))


def _agree(value: Sequence[int | None], own: Sequence[int | None]) -> bool:
    return all(part is None or part == one for part, one in zip(value, own, strict=True))
