"""How far costs may go, and how large tables will be: the linear orders of P2-DPOP, before any table is made.

There is a linear order for each turn: the circle, from the turn's root round to it. A plan goes along it: the axes of
the table that will. A robot asks its neighbours which of them are still to come. Constraints whose other robots all
are will be added by it: so its own table has their axes, and those of the plan but its own.
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
"""A table of as many takes 64 MB, and each robot about eight minutes in each turn."""


class P2DPOPSettings(Settings, frozen=True):
    """`ciphers`: the number of ciphers that a table may have; a run that needs more ends. `spare`: as for P3/2-DPOP."""

    ciphers: int = 20_000
    spare: int = 2

    def __post_init__(self) -> None:
        """Raise `ValueError` for numbers that cannot be."""
        if not 1 <= self.ciphers <= MOST_CIPHERS:
            raise ValueError(f"ciphers is a number of ciphers from 1 to {MOST_CIPHERS:,}, not {self.ciphers}")
        if not 0 <= self.spare <= MOST:
            raise ValueError(f"spare is a number of turns from 0 to {MOST}, not {self.spare}")


class CostSum(Message, frozen=True):
    """Sums over the robots before the receiver in the circle, from a random start: `least` and `range` of costs."""

    least: int
    range: int

    act = Act(Performative.REQUEST, "the receiver is to add how far its costs may go")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "add to these two sums, which began with random numbers, how far your costs may go"


class CostRange(Message, frozen=True):
    """The costs of all robots together are at least `least`, and at most `range` more if no hard constraint breaks."""

    least: int
    range: int

    act = Act(Performative.INFORM, "the receiver learns what all costs may add up to")
    proves_nothing = True  # about a single robot, if there are three robots or more

    def in_words(self, _: Wording) -> str:
        return f"our costs add up to at least {cost_text(self.least)}, and to at most {cost_text(self.range)} more"


class Plan(Message, frozen=True):
    """The axes of the table that the sender will send in this turn: codenames, and how many values each has."""

    turn: int
    axes: Shape

    act = Act(Performative.REQUEST, "the receiver is to plan its own table")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        axes, cells = counted(len(self.axes), "codename"), counted(cells_of(self.axes), "cell")
        return f"in turn {self.turn + 1} there will be a table over {axes} here, with {cells}"


class AskAxis(Message, frozen=True):
    """Asks a neighbour for its axis in this turn, if it has not planned its own table yet."""

    turn: int

    act = Act(Performative.QUERY_REF, "the receiver is asked for the axis of its values")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"what are you called in turn {self.turn + 1}, if you are still to come?"


class Axis(Message, frozen=True):
    """The sender is still to come in this turn. `values` are all that it was declared to have, in a random order."""

    turn: int
    codename: str
    values: list[Value]

    act = Act(Performative.INFORM, "the receiver learns the axis that it asked for")
    proves_nothing = True  # the files declare these values

    def in_words(self, words: Wording) -> str:
        return f"in turn {self.turn + 1} call me {self.codename[:4]}; as declared, {words.domain(self.values)}"


class Gone(Message, frozen=True):
    """The sender stands before the receiver in this turn: constraints between the two are in the table already."""

    turn: int

    act = Act(Performative.REFUSE, "the sender comes before the receiver")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"in turn {self.turn + 1} I come before you"


T = TypeVar("T", bound=np.generic)


class OwnAxis(NamedTuple):
    """The own axis in one turn: its `codename`, and for each code the place of the value among the declared ones."""

    codename: str
    order: Sequence[int]

    def codes(self, places: Mapping[int, int]) -> dict[int, int]:
        """Return the codes of own values, each with the value's place in the compiled domain."""
        return {code: places[place] for code, place in enumerate(self.order) if place in places}


class Place(NamedTuple):
    """The axes of the table that comes, and of the one that goes on; `later` are neighbours still to come."""

    incoming: Shape
    outgoing: Shape
    later: Mapping[str, Axis]

    @property
    def cells(self) -> int:
        """Return the number of cells of the table that goes on."""
        return cells_of(self.outgoing)


def place_after(problem: LocalProblem, own: OwnAxis, incoming: Shape, later: Mapping[str, Axis]) -> Place:
    """Return the place of a robot that eliminates itself. Axes are in an order that says nothing.

    Raises:
        ValueError: if a neighbour's axis has another size than the table's.
    """
    outgoing = {codename: size for codename, size in incoming.items() if codename != own.codename}
    for agents, _ in problem.scopes(later):
        for agent in agents:
            size = len(later[agent].values)
            if outgoing.setdefault(later[agent].codename, size) != size:
                raise ValueError(f"a table in which {agent} has another number of values than it says")
    return Place(incoming, dict(sorted(outgoing.items())), later)


def own_costs(problem: LocalProblem) -> Costs:
    """Return what each own value costs whatever other robots do."""
    own = np.array(problem.charges, np.float64)
    for table in problem.tables({}):
        own = own + table.charges
    return own


def own_places(problem: LocalProblem) -> dict[int, int]:
    """Return, for each place among the declared values, the place of the own value; the cheapest, of several.

    Several look alike only where no neighbour sees any variable. Declared values that the robot cannot take are left
    out.
    """
    costs = own_costs(problem)
    declared: dict[Value, int] = {value: place for place, value in enumerate(problem.declared(problem.agent))}
    found: dict[int, int] = {}
    for index, value in enumerate(problem.values):
        place = declared[value]
        if place not in found or costs[index] < costs[found[place]]:
            found[place] = index
    return found


def sources(place: Place, codename: str, codes: Sequence[int]) -> Sources:
    """Return, for each own code and each cell of the table that goes on, the cell of the table that comes."""
    cells = np.arange(cells_of(place.incoming)).reshape(list(place.incoming.values()))
    axes = list(place.incoming)
    cells = cells.take(codes, axes.index(codename)) if codename in axes else cells[..., np.newaxis]
    spread = _aligned(cells, axes if codename in axes else [*axes, codename], (codename, *place.outgoing))
    return np.broadcast_to(spread, (len(codes), *place.outgoing.values())).reshape(len(codes), -1)


def costs_to_add(problem: LocalProblem, place: Place, codename: str, indices: Sequence[int]) -> Costs:
    """Return, for the own values at `indices` and each cell of the table that goes on, what they cost there.

    That is, the private costs, and those of constraints of which all other robots are still to come.
    """
    onto = (codename, *place.outgoing)
    added = np.zeros((len(indices), *place.outgoing.values()), np.float64)
    added += _aligned(np.array(problem.charges, np.float64)[list(indices)], [codename], onto)
    for table in problem.tables({name: axis.values for name, axis in place.later.items()}):
        names = [*(place.later[agent].codename for agent in table.agents), codename]
        added += _aligned(table.charges.take(list(indices), -1), names, onto)
    return added.reshape(len(indices), -1)


def _aligned(table: NDArray[T], axes: Sequence[str], onto: Sequence[str]) -> NDArray[T]:
    """Return `table` with its axes as in `onto`, of length 1 where it has none."""
    table = table.transpose([axes.index(codename) for codename in onto if codename in axes])
    return table[tuple([slice(None) if codename in axes else np.newaxis for codename in onto])]


CODENAME = 32
"""Hexadecimal digits."""
MOST_AXES = 1_000
SUM = 1 << 62
"""Sums of costs are taken modulo this number; they begin with a random one below it."""


class LinearOrderProtocol(RerootingProtocol):
    """One agent that finds its place in the linear order of each turn, and then runs a protocol on these.

    State, besides the circle's, in the order in which it becomes known:

    - `costs`: the least that all costs add up to, and how much more it can be;
    - `step`: how many times an order has been gone through: first once for each turn without tables, then with them;
    - `axes`, the own axis of each turn, and `places`, the axes of the tables that come and go.
    """

    settings: ClassVar[P2DPOPSettings] = P2DPOPSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.costs: CostRange | None = None
        self.step = 0
        self.axes: dict[int, OwnAxis] = {}
        self.places: dict[int, Place] = {}
        self.is_root = False
        """Of the turn under way."""
        self._mask = CostSum(0, 0)
        self._pending: Plan | None = None
        self._answers: dict[str, Axis | None] = {}
        """Of the neighbours that have answered; None: it comes before this robot."""

    @abstractmethod
    def decide_alone(self) -> None:
        """Take the best value; there is no neighbour."""

    @abstractmethod
    def send_first_table(self) -> None:
        """As the root: send the table of the own axis."""

    @property
    def spare(self) -> int:
        """Return the largest number of turns that are played for show."""
        return self.settings.spare

    @property
    def turn(self) -> int:
        """Return the number of the turn under way; it comes twice, first without tables."""
        return self.step % self.turns

    @property
    def planning(self) -> bool:
        """Return whether the turns are still gone through without tables."""
        return self.step < self.turns

    @property
    def cipher(self) -> CostCipher:
        """Return what encrypts costs. Raises `ValueError` before it is known how far they may go."""
        _, key = self.in_ring()
        if self.costs is None:
            raise ValueError("how far costs may go is not known yet")
        return CostCipher(key, self.costs.range + 1)

    # The circle, and how far costs may go

    def start_in_tree(self) -> None:
        """Take the place in the circle; the first robot begins. A robot alone takes its best value."""
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
        """Return the least of the private costs."""
        return int(min([cost for cost in self.problem.charges if cost < INFINITE], default=0))

    def _with_own_costs(self, total: CostSum) -> CostSum:
        """Return the sums with the private costs, and with the constraints of which this robot is the lowest."""
        dearest = max([cost for cost in self.problem.charges if cost < INFINITE], default=0)
        most = dearest + sum(charge for _, charge in self.problem.scopes(self.ancestors))
        check_exact(most)
        return CostSum((total.least + self.least_own) % SUM, (total.range + int(most) - self.least_own) % SUM)

    def add_costs(self, total: CostSum) -> None:
        """Add the own costs; the first robot takes the random numbers out, and tells all."""
        ring, _ = self.in_ring()
        if self.costs is not None:
            raise ValueError("sums of costs that are known already")
        if not ring.is_first:
            self.send(ring.onward, self._with_own_costs(total))
            return
        least, most = (total.least - self._mask.least) % SUM, (total.range - self._mask.range) % SUM
        check_exact(least + most)
        self._tell_costs(CostRange(least, most))
        self.open_ring()

    def learn_costs(self, sender: str, costs: CostRange) -> None:
        """Take what the first robot has found, and tell it below."""
        ring, _ = self.in_ring()
        if sender != ring.parent or self.costs is not None or min(costs.least, costs.range) < 0:
            raise ValueError(f"{sender} has no costs of all to tell")
        self._tell_costs(costs)

    def _tell_costs(self, costs: CostRange) -> None:
        """Take what the first robot has found, and tell it below."""
        ring, _ = self.in_ring()
        self.costs = costs
        for child in ring.children:
            self.send(child, costs)

    # Turns

    def start_turn(self) -> None:
        """Be the root, if it is the own turn and known to be: send the plan, or the table, of the own axis."""
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
        """Tell all that the next turn begins, unless this was the last."""
        self.is_root = False
        if self.step + 1 < 2 * self.turns:
            self._next_turn(None)

    def start_next_turn(self, sender: str) -> None:
        """Begin the next turn, and pass on that it does."""
        ring, _ = self.in_ring()
        if sender not in ring.neighbours or self.is_root or self.step + 1 >= 2 * self.turns:
            raise ValueError(f"{sender} cannot end a turn")
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
        """Return the own axis of a turn; draw it when it is needed first. Raises `TooLargeError`."""
        if turn not in self.axes:
            size = self.problem.declared_count(self.problem.agent)
            self._refuse_large(size, 1)
            codename = f"{self.secret(4 * CODENAME):0{CODENAME}x}"
            self.axes[turn] = OwnAxis(codename, shuffled(range(size), self.secret))
        return self.axes[turn]

    def _refuse_large(self, cells: int, axes: int) -> None:
        """Raise `TooLargeError` if so many cells have more ciphers than a table may have."""
        levels = self.cipher.levels
        if cells * levels > self.settings.ciphers:
            raise TooLargeError(
                f"{self.problem.agent} needs a table of {cells * levels:,} ciphers"
                f" ({cells * levels * self.cipher.size:,} bytes), more than {self.settings.ciphers:,}: in one of the"
                f" linear orders it has {cells:,} cells over {axes:,} robots, and costs from 0 to {levels - 1:,}"
                " (--set ciphers=N raises the limit)"
            )

    def plan(self, plan: Plan) -> None:
        """Ask the neighbours which of them are still to come; the root ends the turn."""
        if not self.planning or plan.turn != self.turn or self._pending is not None:
            raise ValueError(f"a plan for turn {plan.turn}, which is not under way")
        own = self.own_axis(self.turn)
        if (
            len(plan.axes) > MOST_AXES
            or min(plan.axes.values(), default=1) < 1
            or plan.axes.get(own.codename, len(own.order)) != len(own.order)
        ):
            raise ValueError("a plan that cannot be")
        if self.is_root:
            if plan.axes != {own.codename: len(own.order)}:
                raise ValueError("a plan of which more is left than the root's own axis")
            self.end_turn()
            return
        if self.turn in self.places:
            raise ValueError("a second plan for the same turn")
        self._pending = plan
        self._answers = {}
        for name in self.problem.neighbours:
            self.send(name, AskAxis(self.turn))

    def answer(self, sender: str, turn: int) -> None:
        """Tell a neighbour the own axis, or that this robot comes before it."""
        if sender not in self.problem.neighbours or not 0 <= turn < self.turns:
            raise ValueError(f"{sender} cannot ask for an axis")
        if turn in self.places:
            self.send(sender, Gone(turn))
            return
        own = self.own_axis(turn)
        values = self.problem.declared(self.problem.agent)
        self.send(sender, Axis(turn, own.codename, [values[place] for place in own.order]))

    def receive_answer(self, sender: str, answer: Axis | Gone) -> None:
        """Once all have answered: plan the own table, and tell the next robot."""
        if self._pending is None or sender not in self.problem.neighbours or sender in self._answers:
            raise ValueError(f"{sender} was not asked for an axis")
        if answer.turn != self._pending.turn:
            raise ValueError(f"{sender} tells an axis of another turn")
        self._answers[sender] = self._checked(sender, answer) if isinstance(answer, Axis) else None
        if len(self._answers) < len(self.problem.neighbours):
            return
        ring, _ = self.in_ring()
        plan, self._pending = self._pending, None
        later = {name: axis for name, axis in self._answers.items() if axis is not None}
        place = place_after(self.problem, self.own_axis(plan.turn), plan.axes, later)
        self._refuse_large(place.cells, len(place.outgoing))
        self.places[plan.turn] = place
        self.send(ring.onward, Plan(plan.turn, place.outgoing))

    def _checked(self, sender: str, axis: Axis) -> Axis:
        """Return an axis. Raises `ValueError` unless it has each declared value of its robot once."""
        if len(axis.codename) != CODENAME or len(axis.values) != self.problem.declared_count(sender):
            raise ValueError(f"{sender} tells an axis that cannot be")
        if sorted(map(str, axis.values)) != sorted(map(str, self.problem.declared(sender))):
            raise ValueError(f"{sender} tells values that it was not declared to have")
        return axis
