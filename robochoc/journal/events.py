"""The events of a run, which runtimes report to observers."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from typing import Any, assert_never

import msgspec
from msgspec import UNSET, UnsetType


class Event(msgspec.Struct, frozen=True, gc=False, tag=True, tag_field="event", kw_only=True):
    """The base of all events. `t`: seconds since the start of the run; in the simulator, steps.

    Events refer to no events, so that Python's collector of cycles need not visit them: runs create millions.
    """

    t: float


class Began(Event, frozen=True):
    """A run of `protocol` begins, or the epoch `epoch` in it, which was opened by `opened_by`.

    Withdrawal is a separate run after the search. All counts restart at 0. Times can be compared only within a run or
    an epoch. `minimises`: the run minimises costs, so there may be `Improved` events.

    `start`: the values from which the search begins, by variable, if they are known (null: the robot withdraws).
    `upper_bound`: the cost of these values, if the robots know it; they search for lower costs only. `continues`: the
    search is for the same problem as the previous one, so the best assignment known so far remains known.
    """

    protocol: str
    epoch: int | UnsetType = UNSET
    opened_by: str | UnsetType = UNSET
    minimises: bool | UnsetType = UNSET
    start: dict[str, int | None] | UnsetType = UNSET
    upper_bound: float | int | UnsetType = UNSET
    continues: bool | UnsetType = UNSET


class Given(Event, frozen=True):
    """The robots' problems at the beginning of a run or an epoch, after its `Began`. They are sufficient for a replay.

    Attributes:
        order: The priority order, with all robots of the team.
        robots: The XML files, by robot, that differ from the previous `Given`, or all files. If the problems cannot be
            written, `robots` is empty and `why` is the reason.
        seed: A parameter of the run (`solver/agent_problem.py`), like `settings` and `aside`, the withdrawal cost.
        fresh: The robots that start again.
        void_keys: Invalidated parts of the previous epoch (`solver/explanation.py`), like `void_agents`.
        quiet: True if no message of the previous epoch was lost.
        shown: By robot, the variables that its neighbours see although its file does not show them.
        empty: The variables without remaining values, which a file cannot express (`journal/team_events.py`).
        told_in: The user's units of costs, if they differ from the protocols' minimised integers of 0 or more: whether
            costs are maximised, their decimal places, and a constant that is added to the sum (`model/costs.py`).
        any_step: True if the values of real variables may be anywhere in their intervals (`model/real.py`).
    """

    order: tuple[str, ...]
    robots: dict[str, str]
    seed: int = 0
    settings: dict[str, str] = {}
    aside: float | int | None = None
    fresh: tuple[str, ...] = ()
    void_keys: tuple[str, ...] = ()
    void_agents: tuple[str, ...] = ()
    quiet: bool = True
    why: str = ""
    shown: dict[str, tuple[str, ...]] = {}
    empty: tuple[str, ...] = ()
    told_in: tuple[bool, int, int] | UnsetType = UNSET
    any_step: bool | UnsetType = UNSET


class Registered(Event, frozen=True):
    """A robot has registered with the master."""

    robot: str


class DroppedOut(Event, frozen=True):
    """A registered robot has left for the reason `why` before the team was complete. The master waits for it again."""

    robot: str
    why: str


class Sent(Event, frozen=True):
    """`sender` has sent a message with the fields `content`; `clock` is its NCCC clock."""

    sender: str
    receiver: str
    type: str
    content: dict[str, Any]
    bytes: int
    clock: int


class Received(Event, frozen=True):
    """`receiver` has processed a message; `clock` is its NCCC clock afterwards."""

    sender: str
    receiver: str
    type: str
    clock: int


class Decided(Event, frozen=True):
    """A robot has changed its value. With an empty `assignment` it has no value."""

    robot: str
    assignment: dict[str, int]
    clock: int


class Heard(Event, frozen=True):
    """A robot has found or received an incumbent: an assignment of all robots that is cheaper than all earlier ones.

    `values` are the robots' values as visible to others (null for a withdrawn robot). The cost is in the protocols'
    units (`Given.told_in`).
    """

    robot: str
    cost: float | int
    values: dict[str, tuple[int | None, ...]]


class Bounded(Event, frozen=True):
    """A robot has proven a higher lower bound on the costs of a part of the team.

    If several robots have bounds, the sum of the bounds is a bound for the team (`protocols/findings.py`). The event is
    recorded only on request. The bound is in the protocols' units (`Given.told_in`).
    """

    robot: str
    bound: float | int


class Improved(Event, frozen=True):
    """The current assignment, or an incumbent received by a robot, is cheaper than all earlier assignments.

    A robot without a value counts as withdrawn. No robot reports this event: it is computed from other events, in
    journals only. An incumbent lacks the variables that no neighbour sees. The cost is in the user's units.
    """

    cost: int | Decimal
    assignment: dict[str, int]


class Settled(Event, frozen=True):
    """A robot has processed its packet: its NCCC clock, and its constraint checks since the start of the run."""

    robot: str
    clock: int
    checks: int


class Concluded(Event, frozen=True):
    """A robot has concluded the verdict of the search by itself."""

    robot: str
    verdict: str


class Lost(Event, frozen=True):
    """A robot's process has ended before the end of the run."""

    robot: str
    why: str


class Leads(Event, frozen=True):
    """The master `master` leads the team in the term `term`, for the reason `why`, if robots know several masters."""

    master: str
    term: int
    why: str


class Granted(Event, frozen=True):
    """The Authority has granted `what` to `who`. `t` is a Unix time, because the Authority outlives runs.

    `origin` is the origin of the request, as `address:port`; empty if the request did not come over a network.
    """

    who: str
    what: str
    origin: str = ""


class Refused(Event, frozen=True):
    """The request of `who` for `what` was refused, for the reason `why`. For `t` and `origin` see `Granted`.

    `who` is the unverified name given by the other side, or `unknown`. Refusals in a run use the run's time.
    """

    who: str
    what: str
    why: str
    origin: str = ""


AnyEvent = (
    Began
    | Given
    | Registered
    | DroppedOut
    | Sent
    | Received
    | Decided
    | Heard
    | Bounded
    | Improved
    | Settled
    | Concluded
    | Lost
    | Leads
    | Granted
    | Refused
)
Observer = Callable[[AnyEvent], None]


def combined(*observers: Observer | None) -> Observer | None:
    """Return one observer that passes events on to all `observers`, or None if there are no observers."""
    there = [one for one in observers if one is not None]
    if len(there) < 2:  # noqa: PLR2004 - one observer needs no other
        return there[0] if there else None

    def observe(event: AnyEvent) -> None:
        for one in there:
            one(event)

    return observe


def actor(event: AnyEvent) -> str | None:
    """Return the robot whose step contains `event`, or None if the event does not belong to a step."""
    match event:
        case Sent():
            return event.sender
        case Received():
            return event.receiver
        case Heard() | Decided() | Concluded() | Settled():
            return event.robot
        case (
            Began()
            | Given()
            | Registered()
            | DroppedOut()
            | Bounded()
            | Improved()
            | Lost()
            | Leads()
            | Granted()
            | Refused()
        ):
            return None
        case never:
            assert_never(never)
