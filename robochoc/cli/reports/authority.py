"""What `robochoc authority list` tells: a line a name, for people or for machines."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from datetime import UTC, datetime

import msgspec
from rich.console import Console
from rich.table import Table

from robochoc.authority.registry import Member

UNBROKEN = 1000
"""Where no terminal reads it, a name has a line of its own."""


def json_report(members: Sequence[Member], now: float) -> bytes:
    """One JSON object a line: name, role, rights, state at Unix time `now`, and until when, or null."""
    rows = (
        {
            "name": member.name,
            "role": member.role,
            "may": member.may,
            "state": member.state(now),
            "expires": _until(member, now),
        }
        for member in members
    )
    return b"".join(msgspec.json.encode(row) + b"\n" for row in rows)


def print_table(members: Sequence[Member], now: float) -> None:
    """Print name, role, rights, state and expiry (UTC) of each of `members`."""
    table = Table(box=None, header_style="bold")
    for title in ("name", "role", "may", "state", "expires (UTC)"):
        table.add_column(title, no_wrap=True)
    for member in members:
        until = _until(member, now)
        expires = f"{until:%Y-%m-%d %H:%M}" if until else "-"
        rights = ", ".join(member.may) or "-"
        table.add_row(member.name, str(member.role), rights, str(member.state(now)), expires)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else UNBROKEN
    Console(width=width).print(table)


def _until(member: Member, now: float) -> datetime | None:
    until = member.expires(now)
    return datetime.fromtimestamp(int(until), UTC) if until else None
