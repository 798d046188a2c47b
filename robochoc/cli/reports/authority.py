"""The members of an Authority, for people and for machines."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import msgspec

from robochoc.authority.registry import EnrolledName
from robochoc.cli.reports.table import print_table


def members_json(members: Sequence[EnrolledName], now: float) -> bytes:
    """Return one JSON object per line: name, role, rights, state at Unix time `now`, and expiry or null."""
    rows = (
        {
            "name": member.name,
            "role": member.role,
            "may": member.may,
            "state": member.state(now),
            "expires": _expiry(member, now),
        }
        for member in members
    )
    return b"".join(msgspec.json.encode(row) + b"\n" for row in rows)


def print_members(members: Sequence[EnrolledName], now: float) -> None:
    """Print name, role, rights, state and expiry (UTC) of each of `members`."""
    rows = []
    for member in members:
        until = _expiry(member, now)
        expires = f"{until:%Y-%m-%d %H:%M}" if until else "-"
        rows.append((member.name, str(member.role), ", ".join(member.may) or "-", str(member.state(now)), expires))
    print_table(("name", "role", "may", "state", "expires (UTC)"), rows)


def _expiry(member: EnrolledName, now: float) -> datetime | None:
    until = member.expires(now)
    return datetime.fromtimestamp(int(until), UTC) if until else None
