"""The alternatives to a protocol that does not support a problem: other protocols, or the central solver."""

from __future__ import annotations

from dataclasses import replace

from robochoc.model.problem import Team
from robochoc.protocols.traits import Traits
from robochoc.run.compatibility import CENTRAL_TRAITS, max_total, refuse_options, refuse_unfit
from robochoc.run.options import CENTRAL, Options, Runtime
from robochoc.run.registry import installed_protocols
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.weighted import MAX_TOTAL_COST


def alternatives(
    team: Team, options: Options, *, complete: bool = False, costs: bool = False, narrow: bool = False
) -> str:
    """Return what would do instead of the protocol of `options`, as the end of a sentence that refuses it.

    Every protocol is asked as if it had been chosen, but for those that take small problems only.

    Args:
        team: the team with its scenario.
        options: the options that were refused.
        complete: whether the protocol must be complete.
        costs: whether it must minimise costs.
        narrow: whether its tables must not be as wide as DPOP's, which were refused for memory.
    """
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
        return f"; these do: {', '.join(names)} (--protocol)"
    if _central_solver_fits(team, options):
        return f"; no protocol does, but the central solver (--protocol {CENTRAL})"
    too_high = max_total(team, options) >= EXACT
    return f"; no protocol that is installed does{' (scale the costs down)' if too_high else ''}"


def fits(team: Team, options: Options, traits: Traits) -> bool:
    """Return whether a protocol with these traits would take the team, in the search as well."""
    try:
        refuse_team(team, options, traits)
    except UnsupportedError:
        return False
    return True


def refuse_team(team: Team, options: Options, traits: Traits) -> None:
    """Raise `UnsupportedError` if a protocol with these traits would not take the team, also for refusals later on."""
    refuse_unfit(team, options, traits)
    if traits.tables:
        check_exact(max_total(team, options))


def _central_solver_fits(team: Team, options: Options) -> bool:
    """Return whether the central solver would take the team, for sure."""
    if options.runtime is not Runtime.PROCESSES:
        return False
    central = replace(options, protocol=CENTRAL)
    try:
        refuse_options(central)
        refuse_unfit(team, central, CENTRAL_TRAITS)
    except UnsupportedError:
        return False
    return max_total(team, options) <= MAX_TOTAL_COST
