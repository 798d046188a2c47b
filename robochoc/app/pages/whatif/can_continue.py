"""Whether a team can continue from its earlier decision after a change, determined before the run."""

from __future__ import annotations

from robochoc.app.pages.whatif.story import is_dynamic
from robochoc.app.runs.rule_costs import rules_with_costs
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.differences import AnewError, changing_model
from robochoc.app.sketch.palette import Links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelError
from robochoc.run.choice import decided
from robochoc.run.options import Options, Runtime
from robochoc.solver.errors import UnsupportedError

MOST_CHOSEN_FOR = 60
"""For larger teams, the choice of `auto` is not computed before the run."""


def why_not_continue(before: Sketch, after: Sketch) -> str:
    """Return the reason why the team must decide from scratch after a change; empty if it can continue.

    Args:
        before: The team before the change.
        after: The team after the change.
    """
    if rules_with_costs(before) or rules_with_costs(after):
        return say("whatif.before-costs")
    if any(_has_secrets(sketch) for sketch in (before, after)):
        return say("whatif.before-secrets")
    try:
        _ = model_of(after).team
        return _by_protocol(changing_model(before, after).team)
    except AnewError as anew:
        return say("whatif.all-anew", why=say(anew.key, **anew.named))
    except (ModelError, InvalidInputError, UnsupportedError):  # the error is shown elsewhere
        return ""


def _by_protocol(team: Team) -> str:
    if len(team.robots) > MOST_CHOSEN_FOR:
        return ""
    protocol = decided(team, Options(runtime=Runtime.SIMULATOR)).options.protocol
    return "" if is_dynamic(protocol) else say("whatif.before-protocol", protocol=protocol)


def _has_secrets(sketch: Sketch) -> bool:
    """Return whether two robots have a rule that only one of them knows."""
    private = [rule for rule in sketch.rules if rule.on and rule.private and rule.kind in PALETTE]
    return any(PALETTE[rule.kind].links != Links.EACH for rule in private)
