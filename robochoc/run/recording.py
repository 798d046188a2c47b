"""The start of a recording of a run: its header, and the objective for evaluating the robots' decisions."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from robochoc.model.costs import normalized
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.options import AnswerRule, Options, Runtime, ScheduleName, Withdrawal
from robochoc.verification.objective import Objective, withdrawal_cost

if TYPE_CHECKING:
    from robochoc.journal.entries import Header


def objective_to_record(team: Team, options: Options) -> Callable[[], Objective] | None:
    """Return a function that builds the objective of a run, or None if nothing is minimised or the problem changes.

    It is also None if the team has several objectives, which the run combines into one.
    """
    minimum = options.withdraw == Withdrawal.MINIMUM
    if team.dynamic or team.objectives or not (minimum or team.kind == ProblemKind.DISWCSP):
        return None
    counted = normalized(team)
    in_step = options.schedule == ScheduleName.CYCLES or options.runtime == Runtime.ARRAYS
    return lambda: Objective(counted, withdrawal_cost(counted) if minimum else None, in_step=in_step)


def journal_header(team: Team, options: Options) -> Header:
    """Return the header of the run's journal."""
    from msgspec import UNSET  # noqa: PLC0415 - start-up: rarely needed

    from robochoc.journal.entries import BOUNDED, VERSION, Header  # noqa: PLC0415 - as above

    return Header(
        team=team.name,
        protocol=options.protocol,
        runtime=options.runtime,
        seed=options.seed,
        order=options.order or UNSET,
        channel=options.channel.name if options.channel else UNSET,
        message_loss=options.loss or UNSET,
        improve=UNSET if options.improve is None else options.improve,
        limit_s=UNSET if options.limit_s is None else options.limit_s,
        answer=UNSET if options.answer == AnswerRule.BEST else options.answer,
        version=BOUNDED if options.bounds else VERSION,
    )
