"""The range of costs and the sizes of tables in the linear orders of P2-DPOP, before any table is made.

There is a linear order for each turn: the circle, from the root of the turn round to the root again. A plan is sent
along this order: it contains the axes of the later table. A robot asks its neighbours which of them come later in the
order. It will add the constraints whose other robots all come later: so its table has the axes of these robots, and the
axes in the received plan except its own.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import INFINITE
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.key_stream import shuffled
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.private.encrypted_costs import CostCipher, Costs, Sources
from robochoc.protocols.private.p32_dpop import MOST
from robochoc.protocols.private.p_dpop import Shape, cells_of
from robochoc.protocols.private.rerooting import Next, RerootingProtocol
from robochoc.protocols.private.ring import Ring
from robochoc.protocols.settings import Settings
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.errors import TooLargeError
from robochoc.solver.exact_costs import check_exact
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted

MOST_CIPHERS = 1_000_000
"""A table with this many ciphers takes 64 MB, and each robot about eight minutes in each turn."""


class P2DPOPSettings(Settings, frozen=True):
    """`ciphers`: the maximum number of ciphers in a table; a run that needs more ends. `spare`: as for P3/2-DPOP."""

    ciphers: int = 20_000
    spare: int = 2

    def __post_init__(self) -> None:
        if not 1 <= self.ciphers <= MOST_CIPHERS:
            raise ValueError(f"ciphers is {self.ciphers}; it must be from 1 to {MOST_CIPHERS:,}")
        if not 0 <= self.spare <= MOST:
            raise ValueError(f"spare is {self.spare}; it must be from 0 to {MOST} turns")


class CostSum(Message, frozen=True):
    """Sums over the robots that precede the receiver in the circle, masked by random numbers.

    `least` is the sum of the lowest costs, `range` the sum of the cost ranges.
    """

    least: int
    range: int

    act = Act(Performative.REQUEST, "the receiver adds the range of its costs")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "add to these two sums, which began with random numbers, how far your costs may go"


class CostRange(Message, frozen=True):
    """All robots together have costs of at least `least`, and at most `range` more if no hard constraint breaks."""

    least: int
    range: int

    act = Act(Performative.INFORM, "the receiver learns the range of all robots' costs")
    proves_nothing = True  # about a single robot, if there are three robots or more

    def in_words(self, _: Wording) -> str:
        return f"our costs add up to at least {cost_text(self.least)}, and to at most {cost_text(self.range)} more"


class Plan(Message, frozen=True):
    """The axes of the sender's table in this turn: codenames, each with its number of values."""

    turn: int
    axes: Shape

    act = Act(Performative.REQUEST, "the receiver plans its table")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        axes, cells = counted(len(self.axes), "codename"), counted(cells_of(self.axes), "cell")
        return f"in turn {self.turn + 1} there will be a table over {axes} here, with {cells}"


class AskAxis(Message, frozen=True):
    """A request for a neighbour's axis in this turn, if the neighbour has not planned its table yet."""

    turn: int

    act = Act(Performative.QUERY_REF, "the sender asks for the axis of the receiver's values")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"what are you called in turn {self.turn + 1}, if you are still to come?"


class Axis(Message, frozen=True):
    """The axis of a robot that comes later in this turn. `values` are all its declared values, in a random order."""

    turn: int
    codename: str
    values: list[Value]

    act = Act(Performative.INFORM, "the receiver learns the requested axis")
    proves_nothing = True  # the files declare these values

    def in_words(self, words: Wording) -> str:
        return f"in turn {self.turn + 1} call me {self.codename[:4]}; as declared, {words.domain(self.values)}"


class Gone(Message, frozen=True):
    """The sender comes before the receiver in this turn: constraints between the two are already in the table."""

    turn: int

    act = Act(Performative.REFUSE, "the sender comes before the receiver")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"in turn {self.turn + 1} I come before you"


T = TypeVar("T", bound=np.generic)


class OwnAxis(NamedTuple):
    """This robot's axis in a turn: its `codename`, and for each code the index of the declared value."""

    codename: str
    order: Sequence[int]

    def codes(self, places: Mapping[int, int]) -> dict[int, int]:
        """Return the codes of this robot's values, each with the value's index in the compiled domain."""
        return {code: places[place] for code, place in enumerate(self.order) if place in places}


class EliminationStep(NamedTuple):
    """The axes of the received and of the sent table; `later` are the axes of neighbours that come later."""

    incoming: Shape
    outgoing: Shape
    later: Mapping[str, Axis]

    @property
    def cells(self) -> int:
        """The number of cells of the sent table."""
        return cells_of(self.outgoing)


def step_after(problem: LocalProblem, own: OwnAxis, incoming: Shape, later: Mapping[str, Axis]) -> EliminationStep:
    """Return the step of a robot that eliminates itself. The order of axes reveals nothing.

    Raises:
        ValueError: if a neighbour's axis has another size than the table's.
    """
    outgoing = {codename: size for codename, size in incoming.items() if codename != own.codename}
    for agents, _ in problem.scopes(later):
        for agent in agents:
            size = len(later[agent].values)
            if outgoing.setdefault(later[agent].codename, size) != size:
                raise ValueError(f"the axis of {agent} has {size} values, but a different number in the table")
    return EliminationStep(incoming, dict(sorted(outgoing.items())), later)


def own_costs(problem: LocalProblem) -> Costs:
    """Return the cost of each of this robot's values that does not depend on other robots."""
    own = np.array(problem.charges, np.float64)
    for table in problem.tables({}):
        own = own + table.joined()
    return own


def own_places(problem: LocalProblem) -> dict[int, int]:
    """Return, for each index among the declared values, the index of this robot's cheapest value that looks like it.

    Several values look alike only if no neighbour sees any variable. Declared values that the robot cannot choose are
    left out.
    """
    costs = own_costs(problem)
    declared: dict[Value, int] = {value: place for place, value in enumerate(problem.declared(problem.agent))}
    found: dict[int, int] = {}
    for index, value in enumerate(problem.values):
        place = declared[value]
        if place not in found or costs[index] < costs[found[place]]:
            found[place] = index
    return found


def sources(place: EliminationStep, codename: str, codes: Sequence[int]) -> Sources:
    """Return, for each of this robot's codes and each cell of the sent table, the cell of the received table."""
    cells = np.arange(cells_of(place.incoming)).reshape(list(place.incoming.values()))
    axes = list(place.incoming)
    cells = cells.take(codes, axes.index(codename)) if codename in axes else cells[..., np.newaxis]
    spread = _aligned(cells, axes if codename in axes else [*axes, codename], (codename, *place.outgoing))
    return np.broadcast_to(spread, (len(codes), *place.outgoing.values())).reshape(len(codes), -1)


def costs_to_add(problem: LocalProblem, place: EliminationStep, codename: str, indices: Sequence[int]) -> Costs:
    """Return, for the own values at `indices` and each cell of the sent table, the costs that are added there.

    These are the private costs, and those of constraints whose other robots all come later.
    """
    onto = (codename, *place.outgoing)
    added = np.zeros((len(indices), *place.outgoing.values()), np.float64)
    added += _aligned(np.array(problem.charges, np.float64)[list(indices)], [codename], onto)
    for table in problem.tables({name: axis.values for name, axis in place.later.items()}):
        names = [*(place.later[agent].codename for agent in table.agents), codename]
        added += _aligned(table.joined().take(list(indices), -1), names, onto)
    return added.reshape(len(indices), -1)


def _aligned(table: NDArray[T], axes: Sequence[str], onto: Sequence[str]) -> NDArray[T]:
    """Return `table` with its axes as in `onto`, of length 1 if it lacks the axis."""
    table = table.transpose([axes.index(codename) for codename in onto if codename in axes])
    return table[tuple([slice(None) if codename in axes else np.newaxis for codename in onto])]


CODENAME = 32
"""The number of hexadecimal digits in a codename."""
MOST_AXES = 1_000
SUM = 1 << 62
"""Sums of costs are modulo this number; they begin with a random number below it."""


class LinearOrderProtocol(RerootingProtocol):
    """One agent that finds its position in the linear order of each turn, and then runs a protocol on these orders.

    State besides that of the circle, in the order in which it becomes known:

    - `costs`: the least total cost, and the range above it;
    - `step`: the number of rounds through an order: first one round for each turn without tables, then with tables;
    - `axes`, this robot's axis in each turn, and `places`, the axes of the received and sent tables.
    """

    settings: ClassVar[P2DPOPSettings] = P2DPOPSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.costs: CostRange | None = None
        self.step = 0
        self.axes: dict[int, OwnAxis] = {}
        self.places: dict[int, EliminationStep] = {}
        self.is_root = False
        """True if this robot is the root of the present turn."""
        self._mask = CostSum(0, 0)
        self._pending: Plan | None = None
        self._answers: dict[str, Axis | None] = {}
        """The answers of neighbours; None: the neighbour comes before this robot."""

    @abstractmethod
    def decide_alone(self) -> None:
        """Choose the best value; there is no neighbour."""

    @abstractmethod
    def send_first_table(self) -> None:
        """As the root: send the table of this robot's axis."""

    @property
    def spare(self) -> int:
        """The largest number of additional turns, which hide the number of robots."""
        return self.settings.spare

    @property
    def turn(self) -> int:
        """The number of the present turn; each number occurs twice, first without tables."""
        return self.step % self.turns

    @property
    def planning(self) -> bool:
        """True if the turns are still executed without tables."""
        return self.step < self.turns

    @property
    def cipher(self) -> CostCipher:
        """The encryption of costs. Raises `ValueError` before their range is known."""
        _, key = self.in_ring()
        if self.costs is None:
            raise ValueError("the range of costs is not known yet")
        return CostCipher(key, self.costs.range + 1)

    # The circle, and the range of costs

    def start_in_tree(self) -> None:
        """Join the circle; the first robot starts. A robot alone chooses its best value."""
        if not self.problem.neighbours:
            self.decide_alone()
            return
        ring = Ring(self.parent, self.children)
        self.join_ring(ring)
        if ring.is_first:
            self._mask = CostSum(self.secret(62), self.secret(62))
            self.send(ring.onward, self._with_own_costs(self._mask))

    @property
    def least_own(self) -> int:
        """The least of the private costs."""
        return int(min([cost for cost in self.problem.charges if cost < INFINITE], default=0))

    def _with_own_costs(self, total: CostSum) -> CostSum:
        """Return the sums with the private costs, and with the constraints whose lowest robot is this one."""
        dearest = max([cost for cost in self.problem.charges if cost < INFINITE], default=0)
        most = dearest + sum(charge for _, charge in self.problem.scopes(self.ancestors))
        check_exact(most)
        return CostSum((total.least + self.least_own) % SUM, (total.range + int(most) - self.least_own) % SUM)

    def add_costs(self, total: CostSum) -> None:
        """Add this robot's costs; the first robot subtracts the random numbers, and sends the result to all."""
        ring, _ = self.in_ring()
        if self.costs is not None:
            raise ValueError("received sums of costs for the second time")
        if not ring.is_first:
            self.send(ring.onward, self._with_own_costs(total))
            return
        least, most = (total.least - self._mask.least) % SUM, (total.range - self._mask.range) % SUM
        check_exact(least + most)
        self._send_costs(CostRange(least, most))
        self.open_ring()

    def learn_costs(self, sender: str, costs: CostRange) -> None:
        """Store the result of the first robot, and send it down."""
        ring, _ = self.in_ring()
        if sender != ring.parent or self.costs is not None or min(costs.least, costs.range) < 0:
            raise ValueError(f"{sender} sent an unexpected or invalid CostRange")
        self._send_costs(costs)

    def _send_costs(self, costs: CostRange) -> None:
        """Store the range of all costs, and send it down."""
        ring, _ = self.in_ring()
        self.costs = costs
        for child in ring.children:
            self.send(child, costs)

    # Turns

    def start_turn(self) -> None:
        """Be the root, if it is known to be this robot's turn: send the plan, or the table, of its axis."""
        if self.is_root or self.own_turns is None or self.turn not in self.own_turns:
            return
        self.is_root = True
        ring, _ = self.in_ring()
        own = self.own_axis(self.turn)
        if self.planning:
            self.send(ring.onward, Plan(self.turn, {own.codename: len(own.order)}))
            return
        self.send_first_table()

    def end_turn(self) -> None:
        """Start the next turn for all robots, unless this was the last."""
        self.is_root = False
        if self.step + 1 < 2 * self.turns:
            self._next_turn(None)

    def start_next_turn(self, sender: str) -> None:
        """Start the next turn, and send on the message about it."""
        ring, _ = self.in_ring()
        if sender not in ring.neighbours or self.is_root or self.step + 1 >= 2 * self.turns:
            raise ValueError(f"{sender} sent an unexpected Next")
        self._next_turn(sender)

    def _next_turn(self, sender: str | None) -> None:
        ring, _ = self.in_ring()
        for name in ring.neighbours:
            if name != sender:
                self.send(name, Next())
        self.step += 1
        self.start_turn()

    # Plans: the axes and sizes of all tables

    def own_axis(self, turn: int) -> OwnAxis:
        """Return this robot's axis in a turn; it is drawn on first use. Raises `TooLargeError`."""
        if turn not in self.axes:
            size = self.problem.declared_count(self.problem.agent)
            self._check_size(size, 1)
            codename = f"{self.secret(4 * CODENAME):0{CODENAME}x}"
            self.axes[turn] = OwnAxis(codename, shuffled(range(size), self.secret))
        return self.axes[turn]

    def _check_size(self, cells: int, axes: int) -> None:
        """Raise `TooLargeError` if a table with this many cells needs more ciphers than allowed."""
        levels = self.cipher.levels
        if cells * levels > self.settings.ciphers:
            raise TooLargeError(
                f"{self.problem.agent} needs a table of {cells * levels:,} ciphers"
                f" ({cells * levels * self.cipher.size:,} bytes), more than {self.settings.ciphers:,}: in one of the"
                f" linear orders it has {cells:,} cells over {axes:,} robots, and costs from 0 to {levels - 1:,}"
                " (--set ciphers=N raises the limit)"
            )

    def plan(self, plan: Plan) -> None:
        """Ask the neighbours which of them come later; the root ends the turn."""
        if not self.planning or plan.turn != self.turn or self._pending is not None:
            raise ValueError(f"received an unexpected plan for turn {plan.turn}")
        own = self.own_axis(self.turn)
        if (
            len(plan.axes) > MOST_AXES
            or min(plan.axes.values(), default=1) < 1
            or plan.axes.get(own.codename, len(own.order)) != len(own.order)
        ):
            raise ValueError(f"received an invalid plan of {len(plan.axes):,} axes")
        if self.is_root:
            if plan.axes != {own.codename: len(own.order)}:
                raise ValueError("the root received a plan with other axes than its own axis")
            self.end_turn()
            return
        if self.turn in self.places:
            raise ValueError(f"received a second plan for turn {plan.turn}")
        self._pending = plan
        self._answers = {}
        for name in self.problem.neighbours:
            self.send(name, AskAxis(self.turn))

    def answer(self, sender: str, turn: int) -> None:
        """Send a neighbour this robot's axis, or a message that this robot comes before it."""
        if sender not in self.problem.neighbours or not 0 <= turn < self.turns:
            raise ValueError(f"{sender} sent an unexpected AskAxis for turn {turn}")
        if turn in self.places:
            self.send(sender, Gone(turn))
            return
        own = self.own_axis(turn)
        values = self.problem.declared(self.problem.agent)
        self.send(sender, Axis(turn, own.codename, [values[place] for place in own.order]))

    def receive_answer(self, sender: str, answer: Axis | Gone) -> None:
        """Once all neighbours have answered, plan this robot's table, and send the plan to the next robot."""
        if self._pending is None or sender not in self.problem.neighbours or sender in self._answers:
            raise ValueError(f"{sender} sent an axis without a request")
        if answer.turn != self._pending.turn:
            raise ValueError(f"{sender} sent an axis of turn {answer.turn}, not of turn {self._pending.turn}")
        self._answers[sender] = self._checked(sender, answer) if isinstance(answer, Axis) else None
        if len(self._answers) < len(self.problem.neighbours):
            return
        ring, _ = self.in_ring()
        plan, self._pending = self._pending, None
        later = {name: axis for name, axis in self._answers.items() if axis is not None}
        step = step_after(self.problem, self.own_axis(plan.turn), plan.axes, later)
        self._check_size(step.cells, len(step.outgoing))
        self.places[plan.turn] = step
        self.send(ring.onward, Plan(plan.turn, step.outgoing))

    def _checked(self, sender: str, axis: Axis) -> Axis:
        """Return `axis`. Raises `ValueError` unless it has each declared value of its robot exactly once."""
        if len(axis.codename) != CODENAME or len(axis.values) != self.problem.declared_count(sender):
            raise ValueError(f"{sender} sent an axis with {len(axis.values):,} values, or an invalid codename")
        if sorted(map(str, axis.values)) != sorted(map(str, self.problem.declared(sender))):
            raise ValueError(f"{sender} sent an axis with other values than the declared ones")
        return axis
