"""The Directory Facilitator of FIPA00023: the registered agents and their services.

Times are arguments, in seconds on any monotonic clock; there is no other input or output. Agents can change only their
own registrations; the caller has authenticated the `requester`. In addition to FIPA's functions, a registration can be
renewed without sending its description.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from robochoc.services.descriptions import (
    AgentDescription,
    Reason,
    RequestRefusedError,
    check_bounds,
    check_description,
    matches,
)

MAX_REGISTRATIONS = 4096
MAX_SUBSCRIPTIONS = 1024


class Notice(NamedTuple):
    """A notice to `subscriber` about the agent `name`: its description, or None if the agent has left.

    An agent that no longer matches the subscription counts as having left, even if it is still registered.
    """

    subscriber: str
    name: str
    description: AgentDescription | None


class _Registration(NamedTuple):
    description: AgentDescription
    ends: float


class Directory:
    """Stores the registrations on a platform. Invalid requests raise `RequestRefusedError`, and change nothing."""

    def __init__(self) -> None:
        self._registered: dict[str, _Registration] = {}
        self._subscriptions: list[tuple[str, AgentDescription]] = []
        self._notices: dict[tuple[str, str], Notice] = {}
        self._expired: dict[str, None] = {}
        self._next_end = math.inf

    def __len__(self) -> int:
        """Return the number of registrations, including those that have expired since the last time given."""
        return len(self._registered)

    def register(self, description: AgentDescription, now: float, *, requester: str) -> None:
        """Register the description of `requester` until its lease ends."""
        check_description(description)
        _authorise(description.name, requester)
        self._remove_expired(now)
        if description.name in self._registered:
            raise RequestRefusedError(Reason.ALREADY_REGISTERED)
        if len(self._registered) >= MAX_REGISTRATIONS:
            raise RequestRefusedError(Reason.INTERNAL_ERROR, f"the directory is full: {MAX_REGISTRATIONS} agents")
        self._expired.pop(description.name, None)
        self._store(description, now)

    def modify(self, description: AgentDescription, now: float, *, requester: str) -> None:
        """Replace the description of `requester` by `description`, and restart its lease."""
        check_description(description)
        _authorise(description.name, requester)
        self._remove_expired(now)
        self._registration(description.name)
        self._store(description, now)

    def renew(self, name: str, now: float, *, requester: str) -> None:
        """Restart the lease of `name`."""
        _authorise(name, requester)
        self._remove_expired(now)
        description = self._registration(name).description
        self._registered[name] = _Registration(description, _end(description, now))

    def deregister(self, name: str, *, requester: str) -> None:
        """Deregister `name` at its own request."""
        if not name:
            raise RequestRefusedError(Reason.MISSING_PARAMETER, "df-agent-description", "name")
        _authorise(name, requester)
        self._registration(name)
        self._remove(name)

    def search(
        self, template: AgentDescription, now: float, max_results: int | None = None
    ) -> tuple[AgentDescription, ...]:
        """Return the agents that match `template`, sorted by name; at most `max_results` (None or negative: all)."""
        check_bounds(template)
        self._remove_expired(now)
        known = self._registered
        names = [template.name] if template.name in known else sorted(known)
        found = tuple(known[name].description for name in names if matches(template, known[name].description))
        return found if max_results is None or max_results < 0 else found[:max_results]

    def expire(self, now: float) -> tuple[str, ...]:
        """Remove agents whose lease has ended; return the names of all agents removed since the last `expire`."""
        self._remove_expired(now)
        names = tuple(self._expired)
        self._expired.clear()
        return names

    def subscribe(self, subscriber: str, template: AgentDescription, now: float) -> None:
        """Notify `subscriber` of the agents that match `template`, now and whenever these change."""
        check_bounds(template)
        if (subscriber, template) not in self._subscriptions:
            if len(self._subscriptions) >= MAX_SUBSCRIPTIONS:
                raise RequestRefusedError(
                    Reason.INTERNAL_ERROR, f"the directory is full: {MAX_SUBSCRIPTIONS} subscriptions"
                )
            self._subscriptions.append((subscriber, template))
        for description in self.search(template, now):
            self._add_notice(subscriber, description.name, description)

    def unsubscribe(self, subscriber: str, template: AgentDescription | None = None) -> None:
        """End the subscription to `template` (None: all subscriptions), and drop notices that were not sent yet."""
        kept = [
            one for one in self._subscriptions if one[0] != subscriber or (template is not None and one[1] != template)
        ]
        if len(kept) == len(self._subscriptions):
            raise RequestRefusedError(Reason.NOT_REGISTERED)
        self._subscriptions = kept
        if template is None:
            self._notices = {key: notice for key, notice in self._notices.items() if key[0] != subscriber}

    def notices(self) -> Sequence[Notice]:
        """Return new notices for subscribers, oldest first, and only the newest notice on each agent."""
        notices = tuple(self._notices.values())
        self._notices.clear()
        return notices

    def _registration(self, name: str) -> _Registration:
        if name not in self._registered:
            raise RequestRefusedError(Reason.NOT_REGISTERED)
        return self._registered[name]

    def _store(self, description: AgentDescription, now: float) -> None:
        before = self._registered.get(description.name)
        ends = _end(description, now)
        self._registered[description.name] = _Registration(description, ends)
        self._next_end = min(self._next_end, ends)
        self._notify(description.name, before.description if before else None, description)

    def _remove(self, name: str) -> None:
        self._notify(name, self._registered.pop(name).description, None)

    def _remove_expired(self, now: float) -> None:
        """Remove agents whose lease has ended at `now`. `_next_end` is never later than the next end of a lease."""
        if now < self._next_end:
            return
        for name in [name for name, known in self._registered.items() if known.ends <= now]:
            self._remove(name)
            self._expired[name] = None
        self._next_end = min((known.ends for known in self._registered.values()), default=math.inf)

    def _notify(self, name: str, before: AgentDescription | None, after: AgentDescription | None) -> None:
        """Add notices to subscribers about the change of the description of `name`."""
        concerned: dict[str, bool] = {}
        for subscriber, template in self._subscriptions:
            if after is not None and matches(template, after):
                concerned[subscriber] = True
            elif before is not None and matches(template, before):
                concerned.setdefault(subscriber, False)
        for subscriber, there in concerned.items():
            self._add_notice(subscriber, name, after if there else None)

    def _add_notice(self, subscriber: str, name: str, description: AgentDescription | None) -> None:
        self._notices.pop((subscriber, name), None)
        self._notices[subscriber, name] = Notice(subscriber, name, description)


def _authorise(name: str, requester: str) -> None:
    if name != requester:
        raise RequestRefusedError(Reason.UNAUTHORISED)


def _end(description: AgentDescription, now: float) -> float:
    return math.inf if description.lease_s is None else now + description.lease_s
