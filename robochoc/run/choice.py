"""Chooses a protocol and an order for a team if the user names none (`--protocol auto`). No other module does this.

`RULES` (`run/choice_rules.py`) are tried from the first to the last. The first rule whose conditions hold, and whose
protocol accepts the team and the options (`run/compatibility`), determines the protocol. If no rule applies, any
installed protocol that accepts the team and the options is chosen, complete protocols first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

from robochoc.model.costs import NormalizationError, normalized
from robochoc.model.orders import Order
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.alternatives import refuse_team
from robochoc.run.choice_rules import FEW_LOSSES, LOSSY, RULES
from robochoc.run.choice_stages import with_stages
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.context import RunContext
from robochoc.run.defaults import AUTO, CENTRAL, DEFAULT_COST_PROTOCOL, DEFAULT_PROTOCOL
from robochoc.run.facts import LARGE, Facts, Sizes
from robochoc.run.options import Options, Withdrawal
from robochoc.run.registry import UnknownProtocolError, installed_protocols, protocol_named
from robochoc.solver.compile import CompileError, CompileTimeoutError, TeamCompileTimeoutError
from robochoc.solver.compiled_domain import TooManySolutionsError
from robochoc.solver.encoding import is_soft, max_cost
from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted

ACCEPTS = "it accepts the team with these options, unlike the protocols that suit the team better"
NONE_ACCEPTS = "no protocol accepts the team with these options"

FAILURES = (
    CompileError, CompileTimeoutError, TooManySolutionsError, SolverLostError, SolverMissingError,
    TeamCompileTimeoutError, UnsupportedError,
)  # fmt: skip
"""Errors of compiling domains. The choice ignores them, since the run reports them."""


@dataclass(frozen=True)
class ProtocolChoice:
    """The options with the chosen protocol, and the reasons for the choice.

    Attributes:
        options: How to run, with the name of a protocol, and an order if one was chosen.
        analysis: The facts about the team. None if the user named the protocol.
        rejected: The rejected protocols, with the reason for each rejection.
    """

    options: Options
    analysis: Facts | None = None
    rejected: tuple[tuple[str, str], ...] = ()

    @property
    def facts(self) -> tuple[str, ...]:
        """The facts about the team, in words. Empty if the user named the protocol."""
        return () if self.analysis is None else tuple(_in_words(self.analysis))


def choose(team: Team, options: Options, *, environment: bool = False, ordered: bool = True) -> ProtocolChoice:
    """Return `options` with a protocol and an order; each is chosen here if `options` do not specify it.

    Args:
        team: The valid team with its scenario.
        options: How to run.
        environment: True if an environment changes the problem.
        ordered: True if the user chose the order of the team. Otherwise an order is chosen too, for any protocol.
    """
    if options.protocol == AUTO:
        choice = _decided(team, options, environment=environment)
        if choice.analysis is not None:
            staged = with_stages(choice.options, choice.analysis, lambda name, others: accepts(name, team, others))
            choice = replace(choice, options=staged)
    elif (
        ordered
        or options.order is not None
        or options.chosen
        or options.protocol == CENTRAL
        or _keeps_order(options, Facts(team, environment))
    ):
        choice = ProtocolChoice(options)
    else:
        reasons = {**options.chosen, "order": "the imported file orders no robots"}
        choice = ProtocolChoice(replace(options, order=Order.MAX_DEGREE, chosen=reasons))
    if choice.options.order == Order.GIVEN:
        choice = replace(choice, options=replace(choice.options, order=None))
    return choice


def choose_without_analysis(team: Team, options: Options) -> ProtocolChoice:
    """Return the choice for a run without time to analyse the team: the default protocol and the given order."""
    order = None if options.order == Order.GIVEN else options.order
    if options.protocol != AUTO:
        return ProtocolChoice(replace(options, order=order))
    usual = DEFAULT_COST_PROTOCOL if team.kind == ProblemKind.DISWCSP else DEFAULT_PROTOCOL
    chosen = {"protocol": "there was no time to analyse the team"}
    return ProtocolChoice(replace(options, protocol=usual, order=order, chosen=chosen))


def _decided(team: Team, options: Options, *, environment: bool) -> ProtocolChoice:
    """Choose the protocol, since `options` do not name one."""
    try:
        team = normalized(team)
    except NormalizationError:  # the run reports this error
        return ProtocolChoice(replace(options, protocol=DEFAULT_COST_PROTOCOL))
    withdrawal = options.withdraw is not None
    facts = Facts(team, environment, lambda: _compiled_sizes(team, options), options.loss, withdrawal)
    rejected: dict[str, list[str]] = {}
    for rule in RULES:
        against = rule.unmet(facts)
        if not against:
            chosen = _chosen(facts, options, rule.protocol, rule.why, rule.order)
            against = refusal(rule.protocol, team, chosen)
        if not against:
            return _choice(facts, chosen, rejected)
        if against != LOSSY.otherwise:  # without losses the rule is not worth reporting
            rejected.setdefault(rule.protocol, []).append(against)
    for name in _others(tolerating_loss=facts.loss > 0):
        if accepts(name, team, options) and not _ignores_costs(name, facts, options):
            return _choice(facts, _chosen(facts, options, name, ACCEPTS, ORDERS.get(name)), rejected)
    usual = (
        DEFAULT_COST_PROTOCOL if facts.has_costs else DEFAULT_PROTOCOL
    )  # the resulting error text names the protocols that accept the team
    return _choice(facts, _chosen(facts, options, usual, NONE_ACCEPTS, ORDERS[usual]), {})


def choose_for_private_team(team: Team, options: Options) -> ProtocolChoice:
    """Return the choice for a team whose robots do not disclose their constraints, but check them themselves."""
    if options.protocol != AUTO:
        return ProtocolChoice(options)
    if options.message_loss:
        name, why = _loss_tolerant(options.message_loss, costs=Facts(team).has_costs)
    elif Facts(team).has_costs:
        name, why = (
            DEFAULT_COST_PROTOCOL,
            "there are costs; the robots do not disclose their constraints",
        )
    else:
        name, why = DEFAULT_PROTOCOL, "it supports all kinds of constraints, and the robots do not disclose theirs"
    return ProtocolChoice(replace(options, protocol=name, chosen={"protocol": why}))


def _loss_tolerant(loss: float, *, costs: bool) -> tuple[str, str]:
    """Return a protocol for undisclosed constraints that tolerates lost messages, and the reason for the choice."""
    without_costs = "gdba" if loss <= FEW_LOSSES else "dsa"
    name = "regret-matching" if costs else without_costs
    return name, "messages may be lost, which it tolerates; the robots do not disclose their constraints"


def _others(*, tolerating_loss: bool) -> list[str]:
    """Return the installed protocols, sorted by completeness, and on request first by tolerance of losses."""
    found = [
        (tolerating_loss and not one.protocol.traits.bears_loss, not one.protocol.traits.complete, one.name)
        for one in installed_protocols()
        if one.protocol
    ]
    return [name for *_, name in sorted(found)]


def accepts(name: str, team: Team, options: Options) -> bool:
    """Return whether the protocol called `name` accepts the team and the options."""
    return not refusal(name, team, options)


def refusal(name: str, team: Team, options: Options) -> str:
    """Return why the protocol called `name` does not accept the team or the options; empty if it accepts them."""
    try:
        protocol = protocol_named(name)
        refuse_settings(name, protocol, options.settings)
        case = options if options.protocol == name else replace(options, protocol=name)
        refuse_team(team, case, protocol.traits)
    except (UnknownProtocolError, UnsupportedError) as refused:
        return str(refused)
    return ""


def _ignores_costs(name: str, facts: Facts, options: Options) -> bool:
    """Return whether a protocol would ignore costs where `--withdraw minimum` asks for a minimum."""
    if options.withdraw != Withdrawal.MINIMUM or protocol_named(name).traits.costs:
        return False
    return any(is_soft(one) and max_cost(one) > 0 for one in facts.team.constraints())


def _choice(facts: Facts, chosen: Options, rejected: Mapping[str, list[str]]) -> ProtocolChoice:
    others = ((name, whys) for name, whys in rejected.items() if name != chosen.protocol)
    against = tuple((name, "; ".join(dict.fromkeys(whys))) for name, whys in others)
    return ProtocolChoice(chosen, facts, against)


# Orders

ORDERS = MappingProxyType(
    {"sfb": Order.MAX_DEGREE, "afb": Order.MAX_DEGREE, "abt": Order.MAX_DEGREE, "afc-ng": Order.MAX_DEGREE}
)
"""The orders of protocols that no rule suggests. Protocols not listed here build trees, or use no order."""

ORDERS_TEXT = (
    "order, if not given: as above; for sfb with --withdraw minimum dom-deg. The order of the files is kept for other",
    "protocols, and if constraints are partially known, the problem changes, or --withdraw maximal decides by priority",
)
"""The rules of `_chosen`, as lines for the user."""

STATIC = frozenset({"sbt", "abt", "afc", "afc-ng", "afc-tree", "disfc", "syncbb", "afb", "sfb"})
"""Protocols with a static order. A poor order slows these down most."""


def faster_order(team: Team, options: Options) -> Order | None:
    """Return an order that is usually faster than the files' order; None if none is known, or `options` name an order.

    Args:
        team: The team with its scenario.
        options: How to run, with the name of a protocol.
    """
    if options.protocol not in STATIC or options.order is not None or _keeps_order(options, Facts(team)):
        return None
    return Order.MAX_DEGREE


def _chosen(facts: Facts, options: Options, protocol: str, why: str, order: Order | None) -> Options:
    """Return `options` with `protocol`, and with the `order` that suits it, if the order is to be chosen too."""
    if protocol == DEFAULT_COST_PROTOCOL and options.withdraw == Withdrawal.MINIMUM:
        order = Order.DOM_DEG  # robots that must withdraw are found soon
    if options.order is not None or order is None or _keeps_order(options, facts):
        return replace(options, protocol=protocol, chosen={"protocol": why})
    reasons = {"protocol": why, "order": f"{protocol} is usually fastest in it"}
    return replace(options, protocol=protocol, order=order, chosen=reasons)


def _keeps_order(options: Options, facts: Facts) -> bool:
    """Return whether the order of the files must be kept.

    Priorities decide withdrawals, changes depend on the order, and links of partially known constraints are not
    reversed.
    """
    return options.withdraw == Withdrawal.MAXIMAL or facts.changes or facts.partially_known


# Facts


def _compiled_sizes(team: Team, options: Options) -> Sizes | None:
    """Return the sizes of the robots' compiled domains, or None if the domains cannot be compiled."""
    context = RunContext(options)
    try:
        compiled = context.team_compiler().compile(team, every=True)
    except FAILURES:
        return None
    return {name: len(robot.domain.values) for name, robot in compiled.robots.items()}


def _in_words(facts: Facts) -> Iterator[str]:
    """Yield the facts about the team, in words."""
    mean = 2 * facts.links / max(facts.robots, 1)
    pairs = f"{counted(facts.links, 'pair')} of neighbours ({mean:.3g} each in the mean)"
    yield f"{counted(facts.robots, 'robot')}, {pairs}"
    yield _objective(facts)
    if facts.partially_known:
        yield "constraints are partially known"
    if facts.changes:
        yield "the problem changes"
    if facts.loss:
        yield f"messages are lost with a probability of {facts.loss:g} at most"
    yield f"{counted(facts.values, 'value')} in all, {facts.largest_domain:,} of a robot at most"
    if not facts.has_costs:
        yield f"a constrainedness of about {facts.constrainedness:.2f}"
        if facts.crowd:
            yield f"{facts.crowd.robots} robots need different values, and have only {facts.crowd.values}"
    if facts.has_costs and facts.tree.cells <= LARGE:
        yield f"a pseudo-tree of induced width {facts.tree.width}, tables of {facts.tree.cells:,.0f} entries at most"


def _objective(facts: Facts) -> str:
    if not facts.has_costs:
        return "no costs: any solution will do"
    return "utilities are maximised" if facts.team.user_units.maximize else "costs are minimised"
