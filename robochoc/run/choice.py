"""The choice of protocol and order for a team, where none was asked for (`--protocol auto`). No other module chooses.

`RULES` are asked from the first to the last. The first one that holds, and whose protocol accepts the team and the
options (`run/compatibility.py`), decides. Where none does, any installed protocol that accepts them is taken, complete
ones first. The figures behind the rules: docs/guides/which-protocol.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

from robochoc.model.costs import UnboundedCostError, normalized
from robochoc.model.orders import Order
from robochoc.model.problem import Team
from robochoc.model.wording import counted
from robochoc.run.alternatives import fits
from robochoc.run.compatibility import refuse_settings
from robochoc.run.context import RunContext
from robochoc.run.defaults import AUTO, DEFAULT_COST_PROTOCOL, DEFAULT_PROTOCOL
from robochoc.run.facts import LARGE, Facts, Sizes
from robochoc.run.options import CENTRAL, Options, Withdrawal
from robochoc.run.registry import UnknownProtocolError, installed_protocols, protocol_named
from robochoc.solver.compile import CompileError, CompileTimeoutError
from robochoc.solver.domain import TooManySolutionsError
from robochoc.solver.encoding import MAX_TUPLES, UnsupportedError
from robochoc.solver.failures import SolverLostError, SolverMissingError
from robochoc.solver.filters import MAX_FILTER_BITS
from robochoc.solver.team_compiler import OutOfTimeError

NARROW_CELLS = 65_536
"""No table on a narrow pseudo-tree has more entries."""
FEW_ROBOTS = 12
"""Up to so many, `sfb` needs fewer messages than `dpop` even on trees (docs/explanation/sfb.md)."""
MOST_IN_A_TREE = 20_000
"""With more, a token that names all robots on its way is too long."""
MANY_ROBOTS = 300
"""With more, what SFB's messages tell of each robot adds up, and local search is all that ends with costs."""
SPARSE = 8
"""The mean number of neighbours up to which a constraint graph is called sparse."""
LONG_ROW = 65_536
"""The values of all robots together up to which many partial assignments of SFB go into a message."""
NOBODY = "no protocol accepts the team with these options"

FAILURES = (
    CompileError, CompileTimeoutError, TooManySolutionsError, SolverLostError, SolverMissingError, OutOfTimeError,
    UnsupportedError,
)  # fmt: skip
"""What compiling domains may end with. The run tells of it."""


class Rule(NamedTuple):
    """A protocol for teams of one sort: when it is taken, why, and why not where the rule does not hold."""

    protocol: str
    holds: Callable[[Facts], bool]
    why: str
    otherwise: str


RULES = (
    Rule(
        "disfc",
        lambda f: f.partially_known and f.largest_domain <= MAX_FILTER_BITS,
        "constraints are partially known: it takes them, and tells nobody a value",
        "no constraint is partially known, or a domain is too large for its filters",
    ),
    Rule(
        "abt",
        lambda f: f.partially_known,
        "constraints are partially known, and it takes them",
        "no constraint is partially known",
    ),
    Rule(
        "dynabt",
        lambda f: f.changes and not f.has_costs,
        "the problem changes, and it keeps what still holds",
        "the problem does not change, or has costs",
    ),
    Rule(
        "dpop",
        lambda f: f.has_costs and FEW_ROBOTS < f.robots <= MOST_IN_A_TREE and f.tree.cells <= NARROW_CELLS,
        "the constraint graph is nearly a tree: tables are small, and messages few",
        f"there are no costs, or {FEW_ROBOTS} robots at most, or tables of more than {NARROW_CELLS:,} entries",
    ),
    Rule(
        "dsa",
        lambda f: f.has_costs and f.robots > MANY_ROBOTS and not f.forbids,
        "there are too many robots for a proof, and nothing is forbidden: local search ends, with a good answer",
        f"there are no costs, or {MANY_ROBOTS} robots at most, or constraints that forbid something",
    ),
    Rule(
        "abt",
        lambda f: not f.has_costs and f.robots > MANY_ROBOTS and 2 * f.links <= SPARSE * f.robots,
        "there are many robots with few neighbours: they search at the same time, with short messages",
        f"there are costs, or {MANY_ROBOTS} robots at most, or more than {SPARSE} neighbours each in the mean",
    ),
    Rule(
        "afc-ng",
        lambda f: not f.has_costs and (f.values > LONG_ROW or f.largest_table > MAX_TUPLES),
        "domains are large, and it needs no tables",
        "there are costs, or domains are not large",
    ),
    Rule(
        "afb",
        lambda f: f.largest_table > MAX_TUPLES,
        "domains are large, and it needs no tables",
        "domains are not large",
    ),
    Rule(
        "sfb",
        lambda f: True,  # noqa: ARG005 - it is for all that is left
        "it needs few messages, on hard problems too",
        "",
    ),
)
"""The rules, in their order."""


@dataclass(frozen=True)
class Choice:
    """What was chosen for a team, and why.

    Attributes:
        options: How to run: with the name of a protocol, and an order where one was chosen.
        facts: What is known of the team, in words. Empty where the protocol was asked for.
        rejected: Other protocols, and why each was not taken.
    """

    options: Options
    facts: tuple[str, ...] = ()
    rejected: tuple[tuple[str, str], ...] = ()


def decided(team: Team, options: Options, *, environment: bool = False, ordered: bool = True) -> Choice:
    """Return how to run: `options`, with a protocol and an order where they leave these open.

    Args:
        team: The team with its scenario; it is valid.
        options: How to run.
        environment: Whether something outside changes the problem.
        ordered: Whether somebody has given the team its order. Otherwise one is chosen for any protocol.
    """
    if options.protocol == AUTO:
        choice = _decided(team, options, environment=environment)
    elif ordered or options.order is not None or options.chosen or options.protocol == CENTRAL:
        choice = Choice(options)
    else:
        facts = Facts(team, environment)
        choice = Choice(_with_order(options, facts, Order.MAX_DEGREE, "nobody has given the robots an order"))
    if choice.options.order is Order.GIVEN:
        choice = replace(choice, options=replace(choice.options, order=None))
    return choice


def _decided(team: Team, options: Options, *, environment: bool) -> Choice:
    """Return the choice where protocol and order are open."""
    try:
        team = normalized(team)
    except UnboundedCostError:  # the run refuses it
        return Choice(replace(options, protocol=DEFAULT_COST_PROTOCOL))
    facts = Facts(team, environment, lambda: _compiled_sizes(team, options))
    rejected: dict[str, str] = {}
    for name, why, otherwise in _candidates(facts):
        if otherwise:
            rejected[name] = "; ".join(filter(None, [rejected.get(name), otherwise]))
        elif not accepts(name, team, options):
            rejected[name] = "it does not accept the team, or the options"
        else:
            rejected.pop(name, None)
            return _choice(facts, options, (name, why), rejected)
    usual = DEFAULT_COST_PROTOCOL if facts.has_costs else DEFAULT_PROTOCOL  # its refusal names who accepts the team
    return _choice(facts, options, (usual, NOBODY), {})


def decided_unseen(team: Team, options: Options) -> Choice:
    """Return how to run a team whose constraints are known to its robots alone, who refuse what does not suit them."""
    if options.protocol != AUTO:
        return Choice(options)
    if Facts(team).has_costs:
        name, why = DEFAULT_COST_PROTOCOL, "there are costs; the robots keep their constraints, so no more is known"
    else:
        name, why = DEFAULT_PROTOCOL, "it takes all kinds of constraints, and the robots keep theirs"
    return Choice(replace(options, protocol=name, chosen={"protocol": why}))


def _candidates(facts: Facts) -> Iterator[tuple[str, str, str]]:
    """Yield protocols, the best first: the name, why it is taken, and why it is not (empty if it may be)."""
    for rule in RULES:
        yield rule.protocol, rule.why, "" if rule.holds(facts) else rule.otherwise
    others = [one for one in installed_protocols() if one.protocol]
    for complete in (True, False):
        for one in others:
            if one.protocol and one.protocol.traits.complete is complete:
                yield one.name, "it accepts the team with these options, and what suits it better does not", ""


def accepts(name: str, team: Team, options: Options) -> bool:
    """Return whether the protocol called `name` accepts the team and the options."""
    try:
        protocol = protocol_named(name)
        refuse_settings(name, protocol, options.settings)
    except (UnknownProtocolError, UnsupportedError):
        return False
    return fits(team, replace(options, protocol=name), protocol.traits)


def _choice(facts: Facts, options: Options, taken: tuple[str, str], rejected: Mapping[str, str]) -> Choice:
    name, why = taken
    chosen = _with_suitable_order(replace(options, protocol=name, chosen={"protocol": why}), facts)
    return Choice(chosen, tuple(_in_words(facts)), tuple(rejected.items()))


# Orders

ORDERS = MappingProxyType(
    {"sfb": Order.MIN_WIDTH, "afb": Order.MIN_WIDTH, "abt": Order.MAX_DEGREE, "afc-ng": Order.MAX_DEGREE}
)
"""The orders that suit the protocols. Others build trees, or have no use for one."""

STATIC = frozenset({"sbt", "abt", "afc", "afc-ng", "afc-tree", "disfc", "syncbb", "afb", "sfb"})
"""Protocols whose robots keep the order all the time, so that a poor one costs much."""


def faster_order(team: Team, options: Options) -> Order | None:
    """Return an order in which `options` are usually faster than in the files' one. None: they name one, or none is.

    Args:
        team: The team with its scenario.
        options: How to run, with the name of a protocol.
    """
    if options.protocol not in STATIC or options.order is not None:
        return None
    order = _with_order(options, Facts(team), Order.MAX_DEGREE, "").order
    return order if isinstance(order, Order) else None


def _with_suitable_order(options: Options, facts: Facts) -> Options:
    """Return `options` with the order that suits the protocol, if it has one."""
    order = ORDERS.get(options.protocol)
    if options.protocol == DEFAULT_COST_PROTOCOL and options.withdraw is Withdrawal.MINIMUM:
        order = Order.DOM_DEG  # a withdrawal is found soon
    if order is Order.MIN_WIDTH and facts.has_costs:
        order = Order.MAX_DEGREE
    if options.order is not None or order is None:
        return options
    return _with_order(options, facts, order, f"{options.protocol} is usually fastest in it")


def _with_order(options: Options, facts: Facts, order: Order, why: str) -> Options:
    """Return `options` with `order`, unless that of the team must be kept."""
    if options.withdraw is Withdrawal.MAXIMAL or facts.changes or facts.partially_known:
        return options  # it says who is placed first; changes speak of it; PKC links are not turned
    return replace(options, order=order, chosen={**options.chosen, "order": why})


# What is known


def _compiled_sizes(team: Team, options: Options) -> Sizes | None:
    """Return the sizes of the robots' compiled domains; None where these are not found."""
    context = RunContext(options)
    try:
        compiled = context.team_compiler().compile(team, every=True)
    except FAILURES:
        return None
    return {name: len(robot.domain.values) for name, robot in compiled.robots.items()}


def _in_words(facts: Facts) -> Iterator[str]:
    """Yield what is known of the team."""
    yield f"{counted(facts.robots, 'robot')}, {counted(facts.links, 'pair')} of neighbours"
    yield "costs are minimised" if facts.has_costs else "any solution will do"
    if facts.partially_known:
        yield "constraints are partially known"
    if facts.changes:
        yield "the problem changes"
    yield f"{counted(facts.values, 'value')} in all, {facts.largest_domain:,} of a robot at most"
    if facts.has_costs and facts.tree.cells <= LARGE:
        yield f"a pseudo-tree of induced width {facts.tree.width}, tables of {facts.tree.cells:,.0f} entries at most"
