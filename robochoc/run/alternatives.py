"""The alternatives to a protocol that does not support a problem: other protocols, or the central solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from robochoc.model.costs import NormalizationError, normalized
from robochoc.model.objectives import PARETO
from robochoc.model.problem import Team
from robochoc.protocols.traits import Traits
from robochoc.run.choice_rules import RULES
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.team_rules import CENTRAL_TRAITS, max_total, refuse_unfit
from robochoc.run.defaults import CENTRAL
from robochoc.run.facts import Facts
from robochoc.run.options import Options, Runtime
from robochoc.run.registry import InstalledProtocol, installed_protocols
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.weighted import MAX_TOTAL_COST

MOST_NAMED = 3
"""The maximum number of protocols named in a refusal. `robochoc protocols` lists the others."""
_OTHERS = "; these do: "
_NONE = "; no protocol"


def alternatives(
    team: Team, options: Options, *, complete: bool = False, costs: bool = False, narrow: bool = False
) -> str:
    """Return the alternatives to the protocol of `options`, as the end of a sentence that rejects it.

    The text names the three most suitable alternatives, without protocols for small problems only.

    Args:
        team: The team with its scenario.
        options: The options that were refused.
        complete: True if the protocol must be complete.
        costs: True if the protocol must minimise costs.
        narrow: True if its tables must be narrower than DPOP's, because DPOP's tables would need too much memory.
    """
    if options.objectives == PARETO:
        return "; or combine the objectives into a single cost: --objectives weighted:... or lexicographic:..."
    names = [
        offer.name
        for offer in installed_protocols()
        if offer.protocol
        and offer.name != options.protocol
        and offer.protocol.traits.complete >= complete
        and offer.protocol.traits.costs >= costs
        and not offer.protocol.traits.encrypted_tables
        and not (narrow and offer.protocol.traits.wide_tables)
        and fits(team, replace(options, protocol=offer.name), offer.protocol.traits)
    ]
    if names:
        named = _suited(names, team, options)[:MOST_NAMED]
        others = (
            f", and {len(names) - len(named)} more: 'robochoc protocols' lists them" if len(names) > len(named) else ""
        )
        return f"{_OTHERS}{', '.join(named)} (--protocol){others}"
    if _central_solver_fits(team, options):
        return f"{_NONE} does, but the central solver (--protocol {CENTRAL})"
    too_high = max_total(team, options) >= EXACT
    return f"{_NONE} that is installed does{' (scale the costs down)' if too_high else ''}"


def without_alternatives(reason: str) -> str:
    """Return the reason of a refusal without the text of `alternatives`, which depends on the installed protocols."""
    return reason.partition(_OTHERS)[0].partition(_NONE)[0]


def _suited(names: Sequence[str], team: Team, options: Options) -> list[str]:
    """Return `names`, the most suitable first.

    The protocol that `auto` would choose is first. It is followed by protocols in the family of the refused protocol,
    protocols that `auto` chooses for some teams, and complete protocols.
    """
    try:
        facts = Facts(normalized(team), loss=options.message_loss)
    except NormalizationError:
        chosen = []
    else:
        chosen = [rule.protocol for rule in RULES if rule.protocol in names and not rule.unmet(facts)]
    families = {one.name: _family(one) for one in installed_protocols()}
    complete = {one.name for one in installed_protocols() if one.protocol and one.protocol.traits.complete}
    usual = {rule.protocol for rule in RULES}

    def rank(name: str) -> tuple[bool, bool, bool, bool, str]:
        is_kin = families[name] == families.get(options.protocol)
        return name not in chosen[:1], not is_kin, name not in usual, name not in complete, name

    return sorted(names, key=rank)


def _family(one: InstalledProtocol) -> str:
    """Return the package of a protocol's family."""
    return one.protocol.__module__.rpartition(".")[0] if one.protocol else ""


def fits(team: Team, options: Options, traits: Traits) -> bool:
    """Return whether a protocol with these traits accepts the team, before and during the search."""
    try:
        refuse_team(team, options, traits)
    except UnsupportedError:
        return False
    return True


def refuse_team(team: Team, options: Options, traits: Traits) -> None:
    """Raise `UnsupportedError` if a protocol with these traits would refuse the team, before or during the search."""
    refuse_unfit(team, options, traits)
    if traits.tables:
        check_exact(max_total(team, options))


def _central_solver_fits(team: Team, options: Options) -> bool:
    """Return whether the central solver certainly accepts the team."""
    if options.runtime != Runtime.PROCESSES:
        return False
    central = replace(options, protocol=CENTRAL)
    try:
        refuse_options(central)
        refuse_unfit(team, central, CENTRAL_TRAITS)
    except UnsupportedError:
        return False
    return max_total(team, options) <= MAX_TOTAL_COST
