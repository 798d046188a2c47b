"""Distributed arc consistency (DisAC-9), which `--preprocess ac` runs before any protocol.

A robot removes each of its values that has no support: a value that some constraint allows with none of the others'
remaining values, so that it is in no solution. It sends its removals to its neighbours, which remove values in turn.
The result is the same as that of a central algorithm: the largest arc consistent domains. A robot without a value left
proves that there is no solution.

This is not a search: at the end each robot has a reduced domain, not one value. The run then continues with the
requested protocol on these domains.

- **Guarantees**: no value in a solution is removed. It terminates. At most n d messages are sent to each neighbour.
- **Parameters**: none.
- **Reference**: Hamadi: "Optimal distributed arc-consistency", Constraints 7 (2002). Only a digest was available.

The rule that saves messages is from the paper: a robot sends a neighbour its removals, all of them so far, only if one
of them was the last support of a remaining value of the neighbour. The robot then knows that the neighbour removes that
value, without a message.

Choices and differences:

- Constraints over the same robots count as one, which removes more values than each constraint alone.
- Constraints over more than two robots: all their robots receive all removals, because a single robot cannot detect
  that the last combination for a value of another robot is gone.
- Each robot evaluates its constraints once, as tables (`LocalProblem.allowed`); these evaluations are its constraint
  checks, so both robots in a constraint make them. In the paper each check is made once, because robots also learn each
  other's constraints.
- A constraint whose table would be too large is ignored. All removals are still correct.
- Only infinite costs matter.
- The runtime detects quiescence.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from operator import and_
from typing import NamedTuple, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import HasOnly, Proof, Reception
from robochoc.protocols.findings import Findings
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.errors import TooLargeError, UnsupportedError
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted


class Domain(Message, frozen=True):
    """The sender's values."""

    values: tuple[Value, ...]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return words.domain(self.values)

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, self.values)]


class Del(Message, frozen=True):
    """Values that the sender has removed, as indices in its domain (`del`)."""

    places: tuple[int, ...]

    act = Act(Performative.INFORM, "the receiver learns the sender's values that are in no solution")
    # The removal may follow from the constraints of any robot.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"{counted(len(self.places), 'value')} of {words.variables(words.sender)} can be in no solution"


class _Table(NamedTuple):
    """The values of this robot that are consistent with each combination of the codes of `agents`' values."""

    agents: tuple[str, ...]
    codes: tuple[tuple[int, ...], ...]
    masks: Sequence[int]

    def remaining(self, place: int, values: int) -> list[bool]:
        """Return, for each code of the robot at `place`, whether one of its `values` is left."""
        found = [False] * (max(self.codes[place], default=-1) + 1)
        for value, code in enumerate(self.codes[place]):
            if values >> value & 1:
                found[code] = True
        return found


class DisAC(Protocol):
    """One agent. State: `domains` of the neighbours, and the values `left` in them and in its own, as bitmaps.

    `removed` are its removals in order, `sent` the number of removals that each neighbour knows. `always` are the
    neighbours that receive all removals: they share a constraint of more than two robots.
    """

    messages = Domain | Del
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Hamadi 2002",
        complete=False,
        costs=True,
        shared_scopes=True,
        writes_to_non_neighbours=False,
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        scopes = [scope for scope, _ in problem.scopes(problem.neighbours)]
        linked = {robot for scope in scopes for robot in scope}
        self.linked = sorted(linked, key=order.rank.__getitem__)
        self.always = {robot for scope in scopes if len(scope) > 1 for robot in scope}
        self.domains: dict[str, tuple[Value, ...]] = {}
        self.left: dict[str, int] = {}
        self.own = (1 << len(problem.values)) - 1
        self.removed: list[int] = []
        self.sent: dict[str, int] = dict.fromkeys(self.linked, 0)
        self._tables: list[_Table] | None = None

    def start(self) -> None:
        """Send the domain to all robots with which this robot shares a constraint."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
            return
        for neighbour in self.linked:
            self.send(neighbour, Domain(self.problem.values))

    def receive(self, sender: str, message: Message) -> None:
        match cast("Domain | Del", message):
            case Domain(values):
                self.domains[sender] = values
                self.left[sender] = (1 << len(values)) - 1
            case Del(places):
                self._remove(sender, places)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Revise the domain, and send the removals. Do nothing before all domains are known."""
        if self.verdict is not None or len(self.domains) < len(self.linked):
            return
        if self._tables is None:
            self._tables = self._evaluated()
        if self._revise():
            self._send_removals()
        else:
            self.conclude(Verdict.NO_SOLUTION)

    @property
    def findings(self) -> Findings:
        """The indices of the remaining values."""
        return Findings(left=tuple(_places(self.own)))

    def _remove(self, sender: str, places: Iterable[int]) -> None:
        """Remove values from the copy of a neighbour's domain."""
        size = len(self.domains.get(sender, ()))
        for place in places:
            if not 0 <= place < size:
                raise ValueError(f"{sender} removes its value number {place + 1}, but has only {size} values")
            self.left[sender] &= ~(1 << place)

    def _evaluated(self) -> list[_Table]:
        """Return the constraints as tables; constraints over the same robots form one table, unless it is too large."""
        found: dict[tuple[tuple[str, ...], tuple[tuple[int, ...], ...]], Sequence[int]] = {}
        for lowest in self.linked:
            try:
                tables = self.problem.allowed(self.domains, lowest)
            except UnsupportedError:  # too large for a table, so fewer values are removed
                continue
            for table in tables:
                codes = tuple([tuple(range(len(self.domains[robot]))) for robot in table.agents])
                try:
                    masks = table.joined()
                except TooLargeError:
                    codes, masks = tuple(map(tuple, table.codes[:-1])), table.masks
                known = found.get((table.agents, codes))
                found[table.agents, codes] = [*map(and_, masks, known)] if known else masks
        return [_Table(agents, codes, masks) for (agents, codes), masks in found.items()]

    def _revise(self) -> bool:
        """Remove this robot's values without support; return whether any value is left."""
        assert self._tables is not None  # noqa: S101 - made before
        before = self.own
        for table in self._tables:
            left = [table.remaining(place, self.left[robot]) for place, robot in enumerate(table.agents)]
            supported = 0
            for present, mask in zip(itertools.product(*left), table.masks, strict=True):
                if all(present):
                    supported |= mask
            self.own &= supported
        self.removed += _places(before & ~self.own)
        return bool(self.own)

    def _send_removals(self) -> None:
        """Send each neighbour that needs removals all removals that it does not know yet."""
        unsupported = self._unsupported()
        for robot in self.linked:
            news = tuple(self.removed[self.sent[robot] :])
            if news and (robot in self.always or unsupported[robot]):
                self.send(robot, Del(news))
                self.sent[robot] = len(self.removed)
            if robot not in self.always:
                self.left[robot] &= ~unsupported[robot]

    def _unsupported(self) -> dict[str, int]:
        """Return, for each neighbour, its values without support by a remaining value of this robot."""
        assert self._tables is not None  # noqa: S101 - made before
        lost = dict.fromkeys(self.linked, 0)
        for table in self._tables:
            if len(table.agents) == 1:
                (robot,), (codes,) = table.agents, table.codes
                gone = sum([1 << value for value, code in enumerate(codes) if not table.masks[code] & self.own])
                lost[robot] |= gone & self.left[robot]
        return lost


def _places(mask: int) -> list[int]:
    return [place for place in range(mask.bit_length()) if mask >> place & 1]
