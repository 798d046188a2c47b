"""The Directory Facilitator as an agent that answers requests by the protocol fipa-request (FIPA00026).

Requests are fulfilled at once, without sending AGREE first, as FIPA00026 allows. The answer is REFUSE, FAILURE, INFORM,
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
    DirectoryAction,
    DirectoryFunction,
    action_in,
    content_of,
    described,
    description_of,
    max_results_of,
)
from robochoc.services.symbolic import Expression, String, SymbolicExpressionError, Word, list_of, name


def handle(directory: Directory, requester: str, content: str, now: float) -> tuple[Performative, str]:
    """Fulfil a REQUEST with `content` from the agent `requester`; return the answer's performative and content.

    The caller has authenticated the requester. `now` is in seconds; see `Directory`. Invalid requests raise nothing.
    """
    try:
        action = action_in(content)
        try:
            answer = _answer(directory, requester, action, now)
        except RequestRefusedError as refused:
            performative = Performative.FAILURE if refused.reason in FAILURES else Performative.REFUSE
            return performative, content_of(action.expression, _proposition(refused.reason, refused.about))
    except SymbolicExpressionError as bad:
        return Performative.NOT_UNDERSTOOD, content_of(list_of("unsupported-value", String(f"{bad} (at {bad.at})")))
    return Performative.INFORM, content_of(answer)


def subscribe(directory: Directory, requester: str, content: str, now: float) -> tuple[Performative, str]:
    """Subscribe `requester` to the results of the search in a SUBSCRIBE's `content` (see `notification`), and agree.

    This is fipa-subscribe (FIPA00035), except that the content is a search action instead of the equivalent `iota`
    expression, which SL0 lacks. Refusals are as for `handle`.
    """
    try:
        action = action_in(content)
        try:
            if action.function != DirectoryFunction.SEARCH:
                raise RequestRefusedError(Reason.UNSUPPORTED_FUNCTION, action.function[:40])  # noqa: TRY301 - as in `handle`
            directory.subscribe(requester, description_of(_arguments(action, at_most=2)[0]), now)
        except RequestRefusedError as refused:
            return Performative.REFUSE, content_of(action.expression, _proposition(refused.reason, refused.about))
    except SymbolicExpressionError as bad:
        return Performative.NOT_UNDERSTOOD, content_of(list_of("unsupported-value", String(f"{bad} (at {bad.at})")))
    return Performative.AGREE, content_of(action.expression, Word("true"))


def notification(df: AgentIdentifier, notice: Notice) -> str:
    """Return the content of an INFORM to a subscriber about `notice`: the present result of a search for the agent."""
    searched = described(AgentDescription(notice.name))
    action = list_of("action", expression_of(df), list_of(DirectoryFunction.SEARCH, searched))
    found = [] if notice.description is None else [described(notice.description)]
    return content_of(list_of("result", action, list_of("set", *found)))


def _answer(directory: Directory, requester: str, action: DirectoryAction, now: float) -> Expression:
    """Return `(done <action>)`, or for a search `(result <action> (set ...))`."""
    if action.actor.local != DIRECTORY:
        raise RequestRefusedError(Reason.UNRECOGNISED_PARAMETER_VALUE, "action", "actor")
    match action.function:
        case DirectoryFunction.REGISTER:
            directory.register(_only(action), now, requester=requester)
        case DirectoryFunction.MODIFY:
            directory.modify(_only(action), now, requester=requester)
        case DirectoryFunction.DEREGISTER:
            directory.deregister(_only(action).name, requester=requester)
        case DirectoryFunction.SEARCH:
            found = _search(directory, action, now)
            return list_of("result", action.expression, list_of("set", *map(described, found)))
        case other:
            raise RequestRefusedError(Reason.UNSUPPORTED_FUNCTION, other[:40])
    return list_of("done", action.expression)


def _search(directory: Directory, action: DirectoryAction, now: float) -> Sequence[AgentDescription]:
    """Return the results of a search; all results without constraints, though FIPA00023 requires them."""
    template, *constraints = _arguments(action, at_most=2)
    wanted = max_results_of(constraints[0]) if constraints else None
    return directory.search(description_of(template), now, wanted)


def _only(action: DirectoryAction) -> AgentDescription:
    (description,) = _arguments(action, at_most=1)
    return description_of(description)


def _arguments(action: DirectoryAction, at_most: int) -> tuple[Expression, ...]:
    if not action.arguments:
        raise RequestRefusedError(Reason.MISSING_ARGUMENT, "df-agent-description")
    if len(action.arguments) > at_most:
        raise RequestRefusedError(Reason.UNEXPECTED_ARGUMENT, action.function)
    return action.arguments


def _proposition(reason: Reason, about: Sequence[str]) -> Expression:
    """Return the proposition `reason` in SL0, which is a single word if there are no arguments."""
    return list_of(reason, *map(name, about)) if about else Word(reason)
