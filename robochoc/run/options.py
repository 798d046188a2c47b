"""How to run: the options of `robochoc.run.orchestrator.solve`, and of the command line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from robochoc.model.orders import Order
from robochoc.run.defaults import SATISFIES
from robochoc.solver.compile import Limits

if TYPE_CHECKING:
    from robochoc.communication.kill_schedule import Kill
    from robochoc.communication.simulator.channel import ChannelModel

CENTRAL = "central"
"""The protocol that is none: one model of all files, which ACE decides."""


class Runtime(StrEnum):
    """Where robots live: each in its own OS process, all in one thread, or each in a process joined by a network."""

    PROCESSES = "processes"
    SIMULATOR = "simulator"
    NETWORK = "network"


class ScheduleName(StrEnum):
    """How the simulator orders events: by time counted in checks, or any channel next."""

    CONCURRENT = "concurrent"
    RANDOM = "random"


class Withdrawal(StrEnum):
    """Which robots withdraw when the whole team has no solution.

    A minimum withdrawal: as few as possible, by their weights, and proven; or those that find no place, in priority
    order.
    """

    MINIMUM = "minimum"
    MAXIMAL = "maximal"
    FEWEST = MINIMUM

    @classmethod
    def _missing_(cls, value: object) -> Self | None:
        """Return the member that an earlier version spelt `value`."""
        return cls("minimum") if value == "fewest" else None


class OnLoss(StrEnum):
    """What the loss of a robot means: the run fails, or the robot leaves the problem and the others go on."""

    FAIL = "fail"
    WITHDRAW = "withdraw"


@dataclass(frozen=True)
class Options:
    """How to run.

    `timeout` is in seconds of wall-clock time, `messages` a limit on their number. `seed`, `schedule` and `delay`
    are the simulator's; `delay` is the longest a message takes, in constraint checks. A `channel`, instead of these
    two, has the simulator count seconds of computing and radio. `order` is the robots' total priority order, by name
    or as the list of them (None: the files'); `seed` is `Order.RANDOM`'s too. `local` limits the compilation of each
    robot's domain; `cache` says whether solutions of local problems are kept in the user's cache folder. `count` is
    for the central judge: the number of all solutions. `verify` asks for a second opinion on a `no-solution`, or on a
    least cost. `settings` are the protocol's, as text; its chance is drawn from `seed` too. With `on_loss` set to
    withdraw, robots whose processes end leave the problem; up to `spares` of them come back. `patience`, in seconds: a
    robot whose process is stopped (on a network: that is out of reach) for longer is lost; None: stopped ones are
    waited for. `kill` names robots whose processes are
    killed, and when. `filters` are the network's: the channel filters that messages go through.
    """

    protocol: str = SATISFIES
    runtime: Runtime = Runtime.PROCESSES
    seed: int = 0
    timeout: float | None = None
    withdraw: Withdrawal | None = None
    schedule: ScheduleName = ScheduleName.CONCURRENT
    delay: int = 0
    local: Limits = field(default_factory=Limits)
    cache: bool = True
    count: bool = False
    verify: bool = False
    order: Order | tuple[str, ...] | None = None
    messages: int | None = None
    on_loss: OnLoss = OnLoss.FAIL
    spares: int = 0
    patience: float | None = None
    channel: ChannelModel | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    filters: tuple[str, ...] = ()
    kill: tuple[Kill, ...] = ()
