"""The leading master's answers to standby masters, and the copy of the Authority's rules that they receive."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from robochoc.authority.admission import Admission
from robochoc.authority.registry import Right, Role
from robochoc.communication.network.control_messages import Spent, StandbyAnswer, StandbyRequest


class Standbys:
    """Answers the standby masters that follow this master. `send` sends an answer, `spent` returns a search's effort.

    Attributes:
        waiting: The standby masters that do not know yet that the run is over.
        closed: True if the team of this master is complete.
    """

    def __init__(
        self, admission: Admission, send: Callable[[str, StandbyAnswer], None], spent: Callable[[], Spent] = Spent
    ) -> None:
        self.waiting: set[str] = set()
        self.closed = False
        self._admission = admission
        self._send = send
        self._spent = spent
        self._end = ("", False)
        self._has_resigned = False

    def answer(self, sender: str, request: StandbyRequest) -> None:
        """Answer a standby master. Requests of other members are ignored."""
        if self._has_resigned:
            return
        if request.over or sender not in self._admission.names(Role.MASTER):
            self.waiting.discard(sender)
            return
        self.waiting.add(sender)
        self._send(sender, self._answer())

    def end(self, why: str, *, failed: bool) -> None:
        """Announce the end of the run, with its result in words. `failed`: it was not completed."""
        self._end = why, failed
        for name in self.waiting:
            self._send(name, self._answer())

    def resign(self) -> None:
        """Announce that this master does not lead any more, so that a standby master may lead at once."""
        self._has_resigned = True
        for name in self.waiting:
            self._send(name, msgspec.structs.replace(self._answer(), resigned=True))
        self.waiting.clear()

    def _answer(self) -> StandbyAnswer:
        names = {str(role): self._named(role) for role in Role}
        sniffers = self._admission.names(right=Right.SNIFF)
        return StandbyAnswer(names, sniffers, *self._end, closed=self.closed, spent=self._spent())

    def _named(self, role: Role) -> tuple[str, ...]:
        names = self._admission.names(role, invited=True)
        return tuple(name for name in names if not self._admission.is_revoked(name))


class CopiedAdmission:
    """The Authority's rules as in the last answer of a leading master. See `Admission`."""

    def __init__(self, answer: StandbyAnswer) -> None:
        self._answer = answer

    def names(
        self,
        role: Role | None = None,
        right: Right | None = None,
        *,
        invited: bool = False,  # noqa: ARG002 - the copy contains invited names
    ) -> tuple[str, ...]:
        """See `Admission.names`."""
        names = {name for one, known in self._answer.names.items() if role in {None, one} for name in known}
        return tuple(sorted(names if right is None else names & set(self._answer.sniffers)))

    def is_revoked(self, who: str | int) -> bool:
        """See `Admission.is_revoked`. The copy contains no serial numbers, which only renewals need."""
        return who not in self.names()
