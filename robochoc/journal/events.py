"""The events of a run, which runtimes report to observers."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from typing import Any, assert_never

import msgspec
from msgspec import UNSET, UnsetType


class Event(msgspec.Struct, frozen=True, tag=True, tag_field="event", kw_only=True):
    """Base of all events. `t`: in processes seconds since the start of the run, in the simulator steps."""

    t: float


class Began(Event, frozen=True):
    """A run of `protocol` begins, or its epoch `epoch`, which `opened_by` has opened.

    Withdrawing is a run of its own after the search.
    Counts start again from 0; times are compared within a run, or an epoch, only. `minimises`: costs are what it is
    about, so there may be `Improved` events.
    """

    protocol: str
    epoch: int | UnsetType = UNSET
    opened_by: str | UnsetType = UNSET
    minimises: bool | UnsetType = UNSET


class Given(Event, frozen=True):
    """The problem that robots get when a run, or an epoch, begins, after its `Began`. It is enough for a replay.

    `order` is the priority order, with all robots of the team; `robots` holds the XML files, by name, of those
    whose file is another than in the `Given` before (or all; empty, with the reason in `why`: it could not be
    written). Robots in `fresh` start again; `void_keys` and `void_agents` are what no longer stands
    (`solver/explanation.py`), and `quiet` says whether no message of the epoch before was lost. `seed`, `settings`
    and `aside` (the withdrawal cost) are the run's parameters (`solver/agent_problem.py`). What a file cannot say
    stands beside the files, for all robots: `shown`, by name, own variables that neighbours see though the robot's file
    does not say so, and `empty`, the variables that have no value left (`journal/team_events.py`). Costs are integers of 0 or
    more that are minimised; `told_in` says how they are told to the user, where that is otherwise: whether they are
    maximised, their decimal places, and what is added to the sum (`model/costs.py`).
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


class Registered(Event, frozen=True):
    """A robot has confirmed that it is there."""

    robot: str


class DroppedOut(Event, frozen=True):
    """A registered robot is gone, because of `why`, before the team was complete: the master waits for it again."""

    robot: str
    why: str


class Sent(Event, frozen=True):
    """`sender` has sent a message; `clock` is its NCCC clock, `content` the message's fields."""

    sender: str
    receiver: str
    type: str
    content: dict[str, Any]
    bytes: int
    clock: int


class Received(Event, frozen=True):
    """`receiver` has taken a message in; `clock` is its NCCC clock afterwards."""

    sender: str
    receiver: str
    type: str
    clock: int


class Decided(Event, frozen=True):
    """A robot has changed its value; an empty `assignment` means that it has none."""

    robot: str
    assignment: dict[str, int]
    clock: int


class Heard(Event, frozen=True):
    """A robot has found, or received, an assignment of all robots that is cheaper than those before: an incumbent.

    `values` are the robots' values as others see them (null: a withdrawn one). The cost is what protocols count
    (`Given.told_in`).
    """

    robot: str
    cost: float | int
    values: dict[str, tuple[int | None, ...]]


class Bounded(Event, frozen=True):
    """A robot knows that no assignment of the robots that `bound` is for costs less; it was less before.

    Where several robots know bounds, each is for a part of the team, and their sum is for all of it
    (`protocols/findings.py`). It is reported where it was asked for. The cost is what protocols count
    (`Given.told_in`).
    """

    robot: str
    bound: float | int


class Improved(Event, frozen=True):
    """The present assignment, or an incumbent that a robot has received, is cheaper than all before.

    A robot without a value counts as withdrawn. No robot reports this event: it follows from others, and stands in
    journals only. Of an incumbent, variables that no neighbour sees are not known. The cost is in the user's numbers.
    """

    cost: int | Decimal
    assignment: dict[str, int]


class Settled(Event, frozen=True):
    """A robot has dealt with its packet: its NCCC clock, and its constraint checks since the start of the run."""

    robot: str
    clock: int
    checks: int


class Concluded(Event, frozen=True):
    """A robot alone concluded the verdict of the search."""

    robot: str
    verdict: str


class Lost(Event, frozen=True):
    """A robot's process has ended before the run did."""

    robot: str
    why: str


class Granted(Event, frozen=True):
    """The Authority has granted `who` `what`; there `t` is Unix time, as the Authority outlives runs.

    `origin` is where the request came from, as `address:port`; empty where it was no network.
    """

    who: str
    what: str
    origin: str = ""


class Refused(Event, frozen=True):
    """`who` claimed to be allowed `what`, and is not, because `why`. `t` and `origin` as in `Granted`.

    `who` is what the other side said of itself, so it may be anybody's name, or `unknown`. Refusals in a run have the
    run's time.
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
    | Granted
    | Refused
)
Observer = Callable[[AnyEvent], None]


def actor(event: AnyEvent) -> str | None:
    """Return the robot whose step `event` is part of. None: it is not part of a step."""
    match event:
        case Sent():
            return event.sender
        case Received():
            return event.receiver
        case Heard() | Decided() | Concluded() | Settled():
            return event.robot
        case Began() | Given() | Registered() | DroppedOut() | Bounded() | Improved() | Lost() | Granted() | Refused():
            return None
        case never:
            assert_never(never)
