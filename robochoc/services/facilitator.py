"""The Directory Facilitator as an agent: it answers requests by the protocol fipa-request (FIPA00026).

What it is asked it does at once, so it says no AGREE first, as FIPA00026 allows: the answer is REFUSE, FAILURE, INFORM,
or NOT-UNDERSTOOD.
"""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.services.communicative_acts import Performative
from robochoc.services.descriptions import FAILURES, AgentDescription, Reason, Refused
from robochoc.services.directory import Directory
from robochoc.services.sl import (
    DIRECTORY,
    Action,
    Function,
    action_in,
    content_of,
    described,
    description_of,
    max_results_of,
)
from robochoc.services.symbolic import BadExpression, Expression, String, Word, listed, name


def handle(directory: Directory, requester: str, content: str, now: float) -> tuple[Performative, str]:
    """Do what the agent called `requester` asks in a REQUEST's `content`; the answer's performative and content.

    The host has proven who the requester is. `now` is in seconds, see `Directory`. Never raises for what is asked.
    """
    try:
        action = action_in(content)
        try:
            answer = _answer(directory, requester, action, now)
        except Refused as refused:
            performative = Performative.FAILURE if refused.reason in FAILURES else Performative.REFUSE
            return performative, content_of(action.whole, _proposition(refused.reason, refused.about))
    except BadExpression as bad:
        return Performative.NOT_UNDERSTOOD, content_of(listed("unsupported-value", String(f"{bad} (at {bad.at})")))
    return Performative.INFORM, content_of(answer)


def _answer(directory: Directory, requester: str, action: Action, now: float) -> Expression:
    """`(done <action>)`, or of a search `(result <action> (set ...))`."""
    if action.actor.local != DIRECTORY:
        raise Refused(Reason.UNRECOGNISED_PARAMETER_VALUE, "action", "actor")
    match action.function:
        case Function.REGISTER:
            directory.register(_only(action), now, requester=requester)
        case Function.MODIFY:
            directory.modify(_only(action), now, requester=requester)
        case Function.DEREGISTER:
            directory.deregister(_only(action).name, requester=requester)
        case Function.SEARCH:
            found = _search(directory, action, now)
            return listed("result", action.whole, listed("set", *map(described, found)))
        case other:
            raise Refused(Reason.UNSUPPORTED_FUNCTION, other[:40])
    return listed("done", action.whole)


def _search(directory: Directory, action: Action, now: float) -> Sequence[AgentDescription]:
    """Without constraints all are wanted, though FIPA00023 asks that they be given."""
    template, *constraints = _arguments(action, at_most=2)
    wanted = max_results_of(constraints[0]) if constraints else None
    return directory.search(description_of(template), now, wanted)


def _only(action: Action) -> AgentDescription:
    (description,) = _arguments(action, at_most=1)
    return description_of(description)


def _arguments(action: Action, at_most: int) -> tuple[Expression, ...]:
    if not action.arguments:
        raise Refused(Reason.MISSING_ARGUMENT, "df-agent-description")
    if len(action.arguments) > at_most:
        raise Refused(Reason.UNEXPECTED_ARGUMENT, action.function)
    return action.arguments


def _proposition(reason: Reason, about: Sequence[str]) -> Expression:
    """A proposition without arguments is the bare word in SL0."""
    return listed(reason, *map(name, about)) if about else Word(reason)
