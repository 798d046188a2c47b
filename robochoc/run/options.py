"""The options of a run, for `robochoc.run.solve` and the command line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from robochoc.model.objectives import ObjectivesMode
from robochoc.model.orders import Order
from robochoc.model.policies import Risk
from robochoc.run.defaults import AUTO
from robochoc.run.option_values import (
    channel_model,
    count,
    flag,
    instance_of,
    integer,
    items_of,
    kill,
    objectives,
    one_of,
    optional,
    priority_order,
    protocol_name,
    real,
    samples,
    seconds,
    start_values,
    step,
    text,
    texts_by_name,
)
from robochoc.solver.compile import CompileLimits
from robochoc.system.deprecation import warn_deprecated
from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from robochoc.communication.kill_schedule import Kill
    from robochoc.communication.simulator.channel import ChannelModel


class Runtime(StrEnum):
    """The runtime: one process per robot, here or on a network; all robots in one thread; or all robots in arrays."""

    PROCESSES = "processes"
    SIMULATOR = "simulator"
    NETWORK = "network"
    ARRAYS = "arrays"


class ScheduleName(StrEnum):
    """The order in which the simulator handles events: by time counted in checks, in cycles, or by a random channel.

    With `CONCURRENT` a robot reads its whole inbox before it settles, with `ONE_BY_ONE` it settles after each message.
    """

    CONCURRENT = "concurrent"
    CYCLES = "cycles"
    ONE_BY_ONE = "one-by-one"
    RANDOM = "random"


class Withdrawal(StrEnum):
    """The rule that chooses the robots to withdraw when the whole team has no solution.

    `MINIMUM`: the robots with the least total weight, proven. `MAXIMAL`: the robots without a possible value, in
    priority order.
    """

    MINIMUM = "minimum"
    MAXIMAL = "maximal"


class Preprocess(StrEnum):
    """Preprocessing steps. `AC`: robots first make their domains arc consistent (`satisfaction/disac.py`)."""

    AC = "ac"


class OnLoss(StrEnum):
    """The reaction to the loss of a robot: the run fails, or the other robots continue without it."""

    FAIL = "fail"
    WITHDRAW = "withdraw"


class AnswerRule(StrEnum):
    """The answer of a search without a proof.

    `BEST`: the cheapest assignment that is known. `FINAL`: the robots' last values, as in the papers.
    """

    BEST = "best"
    FINAL = "final"


class CentralSolverName(StrEnum):
    """The solver of the merged problem: the best installed one, ACE, CP-SAT of OR-Tools, toulbar2 or cosoco."""

    AUTO = "auto"
    ACE = "ace"
    ORTOOLS = "ortools"
    TOULBAR2 = "toulbar2"
    COSOCO = "cosoco"


class Stage(NamedTuple):
    """A stage of a run with a deadline, in which one protocol searches (`run/stages.py`).

    Attributes:
        protocol: The protocol.
        until: The fraction of the time until the deadline after which the stage ends.
        settings: The protocol's settings, as text.
        kept: The search is restarted whenever it ends, and each robot keeps its value of the best assignment with this
            probability. None: there is one search.
    """

    protocol: str
    until: float
    settings: Mapping[str, str] = {}
    kept: float | None = None


@dataclass(frozen=True)
class Options:
    """The options of a run. `run/compatibility` decides which of them can be combined.

    Every value is converted and checked: members of enums may be given as texts ("minimum"), numbers in any numeric
    type, and tuples as lists.

    Raises:
        TypeError: if a value has a wrong type.
        ValueError: if a value is not allowed.

    Attributes:
        protocol: The name of the protocol, `CENTRAL`, or `AUTO`: chosen for the team (`run/choice.py`).
        runtime: The runtime of the robots.
        seed: The seed of the simulator, of `Order.RANDOM`, and of protocols with random decisions.
        timeout: A limit on wall-clock time, in seconds (None: no limit).
        deadline: A limit like `timeout`, but the best assignment known at the deadline is the answer (None: no
            deadline).
        improve: The seconds after the deadline in which the robots search for better answers (None: they stop).
        answer: The answer of a search that proves nothing: the best known assignment, or the last one.
        repair: True if a local search repairs the assignment of an incomplete protocol that has ended without one that
            satisfies all hard constraints (`run/phases.py`).
        withdraw: The rule by which robots withdraw if the team has no solution (None: no robot withdraws).
        schedule: The order of events in the simulator.
        delay: The longest delay of a message in the simulator, in constraint checks.
        local: Limits on the compilation of each robot's domain.
        cache: True if solutions of local problems are stored in the user's cache folder.
        count: True if solutions, or optima, are counted.
        central_with: The central solver of `CENTRAL`.
        verify: True if central solvers that have not found it themselves check a `no-solution` or a minimum cost.
        order: The total priority order of the robots: its name, or the robots' names (None: the order of the files).
        messages: A limit on the number of messages (None: no limit).
        ncccs: A limit on non-concurrent constraint checks, in the simulator (None: no limit).
        cycles: A limit on cycles, with `ScheduleName.CYCLES` (None: no limit).
        on_loss: The reaction to the loss of a robot (None: the run fails, unless there are `spares`).
        spares: The number of lost robots that are restarted.
        patience: The seconds after which a stopped process (on a network: an unreachable robot) counts as lost (None:
            no limit; on a network 10 seconds).
        channel: A channel model, with which the simulator measures time as the seconds spent on computation and radio.
        message_loss: The probability that a message is permanently lost (0: the probability in `channel`). See `loss`.
        settings: The protocol's settings, as text.
        kill: The robots (with `standby` also masters) whose processes are killed, with the times.
        standby: The number of standby masters on this machine, for `Runtime.NETWORK`.
        filters: The names of the channel filters for messages on a network, in order of application.
        chosen: The reasons for a `protocol` or an `order` that was chosen for the user.
        preprocess: The preprocessing before the protocol (None: no preprocessing).
        cluster: The Dask cluster on which arrays are computed: the address of its scheduler, or the path of the
            scheduler's file (None: this process).
        start: The values from which the search begins, by variable (None: the variable's robot withdraws). Variables
            without a start value begin as in any run.
        cold: True if later epochs do not begin from the last assignment. Dynamic protocols begin with their own
            knowledge in any case.
        stages: The protocols that search in turn until the deadline, of which `protocol` is the last (empty: only
            `protocol` searches). They are chosen, not given.
        refine: The step of the finest grids of real variables, in their unit (None: the precision; infinite: the grids
            of the files are not refined).
        risk: The optimised cost of a problem with random variables.
        bounds: True if events report lower bounds of the cost that robots have proven (processes and simulator).
        samples: The number of samples that replace an expectation over more joint outcomes of random variables (None:
            as in the files, 1,000 for more than 4,096 outcomes).
        objectives: The treatment of several objectives: an `ObjectivesMode`, or its text. None: `pareto`, if the
            protocol is chosen or finds fronts.
    """

    protocol: str = AUTO
    runtime: Runtime = Runtime.PROCESSES
    seed: int = 0
    timeout: float | None = None
    deadline: float | None = None
    improve: float | None = None
    answer: AnswerRule = AnswerRule.BEST
    repair: bool = True
    withdraw: Withdrawal | None = None
    schedule: ScheduleName = ScheduleName.CONCURRENT
    delay: int = 0
    local: CompileLimits = field(default_factory=CompileLimits)
    cache: bool = True
    count: bool = False
    central_with: CentralSolverName = CentralSolverName.AUTO
    verify: bool = False
    order: Order | tuple[str, ...] | None = None
    messages: int | None = None
    ncccs: int | None = None
    cycles: int | None = None
    on_loss: OnLoss | None = None
    spares: int = 0
    patience: float | None = None
    channel: ChannelModel | None = None
    message_loss: float = 0.0
    settings: Mapping[str, str] = field(default_factory=dict)
    filters: tuple[str, ...] = ()
    kill: tuple[Kill, ...] = ()
    standby: int = 0
    chosen: Mapping[str, str] = field(default_factory=dict)
    bounds: bool = False
    preprocess: Preprocess | None = None
    cluster: str | None = None
    start: Mapping[str, int | None] = field(default_factory=dict)
    cold: bool = False
    stages: tuple[Stage, ...] = ()
    refine: float | None = None
    risk: Risk = Risk.EXPECTED
    samples: int | None = None
    objectives: ObjectivesMode | None = None

    def __post_init__(self) -> None:
        for name, given in vars(self).copy().items():
            object.__setattr__(self, name, _CONVERTERS[name](name, given))

    @property
    def limit_s(self) -> float | None:
        """Return the limit on wall-clock time in seconds, set by the timeout or the deadline; None: no limit."""
        return self.timeout if self.deadline is None else self.deadline + (self.improve or 0)

    @property
    def loss(self) -> float:
        """Return the probability that a message is permanently lost, set by the option or the channel model.

        If the probability depends on the link, the largest one is returned.
        """
        return self.message_loss or (self.channel.most_loss if self.channel else 0.0)

    @property
    def dropped(self) -> float:
        """Return the probability with which robots drop received messages; 0 in the simulator, which drops them."""
        return 0.0 if self.runtime == Runtime.SIMULATOR else self.message_loss

    @property
    def wants_anytime(self) -> bool:
        """Return whether the robots must find the best cycle themselves."""
        return self.settings.get("anytime") == "yes"

    @property
    def survives_losses(self) -> bool:
        """Return whether the run continues when a robot is lost."""
        return self.on_loss == OnLoss.WITHDRAW or (self.on_loss is None and self.spares > 0)


def _withdrawal(name: str, value: object) -> object:
    """Convert the name of a withdrawal rule. True, and the former name `fewest`, mean `minimum`; False means None."""
    if value is None or value is False:
        return None
    if value == "fewest":
        warn_deprecated("withdraw='fewest'", "'minimum'", removed_in="2.0", stacklevel=6)
    return Withdrawal.MINIMUM if value in {True, "fewest"} else one_of(Withdrawal)(name, value)


_CONVERTERS = MappingProxyType(
    {
        "protocol": protocol_name,
        "runtime": one_of(Runtime),
        "seed": integer,
        "timeout": optional(seconds),
        "deadline": optional(seconds),
        "improve": optional(seconds),
        "answer": one_of(AnswerRule),
        "repair": flag,
        "withdraw": _withdrawal,
        "schedule": one_of(ScheduleName),
        "delay": count,
        "local": instance_of(CompileLimits),
        "cache": flag,
        "count": flag,
        "central_with": one_of(CentralSolverName),
        "verify": flag,
        "order": optional(priority_order),
        "messages": optional(count),
        "ncccs": optional(count),
        "cycles": optional(count),
        "on_loss": optional(one_of(OnLoss)),
        "spares": count,
        "patience": optional(seconds),
        "channel": optional(channel_model),
        "message_loss": real,
        "settings": texts_by_name,
        "filters": items_of(text, "the names of filters"),
        "kill": items_of(kill, "objects of the class Kill"),
        "standby": count,
        "chosen": texts_by_name,
        "bounds": flag,
        "preprocess": optional(one_of(Preprocess)),
        "cluster": optional(text),
        "start": start_values,
        "cold": flag,
        "refine": optional(step),
        "risk": one_of(Risk),
        "samples": optional(samples),
        "objectives": optional(objectives),
        "stages": items_of(instance_of(Stage), "objects of the class Stage"),
    }
)
"""The converter for each field of `Options`. A field without a converter cannot be set."""
