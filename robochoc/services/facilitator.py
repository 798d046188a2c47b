"""The Directory Facilitator as an agent: it answers requests by the protocol fipa-request (FIPA00026).

What it is asked it does at once, so it says no AGREE first, as FIPA00026 allows: the answer is REFUSE, FAILURE, INFORM,
or NOT-UNDERSTOOD.
"""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols.acts import Performative
from robochoc.services.descriptions import FAILURES, AgentDescription, Reason, RequestRefusedError
from robochoc.services.directory import Directory, Notice
from robochoc.services.identifier import AgentIdentifier, expression_of
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
from robochoc.services.symbolic import Expression, String, SymbolicExpressionError, Word, list_of, name


def handle(directory: Directory, requester: str, content: str, now: float) -> tuple[Performative, str]:
    """Do what the agent called `requester` asks in a REQUEST's `content`; the answer's performative and content.

    The host has proven who the requester is. `now` is in seconds, see `Directory`. Never raises for what is asked.
    """
    try:
        action = action_in(content)
        try:
            answer = _answer(directory, requester, action, now)
        except RequestRefusedError as refused:
            performative = Performative.FAILURE if refused.reason in FAILURES else Performative.REFUSE
            return performative, content_of(action.whole, _proposition(refused.reason, refused.about))
    except SymbolicExpressionError as bad:
        return Performative.NOT_UNDERSTOOD, content_of(list_of("unsupported-value", String(f"{bad} (at {bad.at})")))
    return Performative.INFORM, content_of(answer)


def subscribe(directory: Directory, requester: str, content: str, now: float) -> tuple[Performative, str]:
    """Notify `requester` from now on of what a SUBSCRIBE's `content` searches for (see `notification`), and agree.

    By fipa-subscribe (FIPA00035), where the content would be an `iota` expression, which SL0 does not have: here it is
    the search action that would find the same. What is refused comes as from `handle`.
    """
    try:
        action = action_in(content)
        try:
            if action.function != Function.SEARCH:
                raise RequestRefusedError(Reason.UNSUPPORTED_FUNCTION, action.function[:40])  # noqa: TRY301 - as in `handle`
            directory.subscribe(requester, description_of(_arguments(action, at_most=2)[0]), now)
        except RequestRefusedError as refused:
            return Performative.REFUSE, content_of(action.whole, _proposition(refused.reason, refused.about))
    except SymbolicExpressionError as bad:
        return Performative.NOT_UNDERSTOOD, content_of(list_of("unsupported-value", String(f"{bad} (at {bad.at})")))
    return Performative.AGREE, content_of(action.whole, Word("true"))


def notification(df: AgentIdentifier, notice: Notice) -> str:
    """Return the content of the INFORM on `notice` to a subscriber: the result of a search for that agent now."""
    searched = described(AgentDescription(notice.name))
    action = list_of("action", expression_of(df), list_of(Function.SEARCH, searched))
    found = [] if notice.description is None else [described(notice.description)]
    return content_of(list_of("result", action, list_of("set", *found)))


def _answer(directory: Directory, requester: str, action: Action, now: float) -> Expression:
    """`(done <action>)`, or of a search `(result <action> (set ...))`."""
    if action.actor.local != DIRECTORY:
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, "action", "actor")
    match action.function:
        case Function.REGISTER:
            directory.register(_only(action), now, requester=requester)
        case Function.MODIFY:
            directory.modify(_only(action), now, requester=requester)
        case Function.DEREGISTER:
            directory.deregister(_only(action).name, requester=requester)
        case Function.SEARCH:
            found = _search(directory, action, now)
            return list_of("result", action.whole, list_of("set", *map(described, found)))
        case other:
            raise RequestRefusedError(Reason.UNSUPPORTED_FUNCTION, other[:40])
    return list_of("done", action.whole)


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
        raise RequestRefusedError(Reason.MISSING_ARGUMENT, "df-agent-description")
    if len(action.arguments) > at_most:
        raise RequestRefusedError(Reason.UNEXPECTED_ARGUMENT, action.function)
    return action.arguments


def _proposition(reason: Reason, about: Sequence[str]) -> Expression:
    """Return the proposition `reason` in SL0; one without arguments is the bare word."""
    return list_of(reason, *map(name, about)) if about else Word(reason)
