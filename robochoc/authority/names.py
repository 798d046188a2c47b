"""Checks names of members, and describes the enrolled names."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from robochoc.authority.certificates import LONGEST_NAME, MASTER
from robochoc.authority.registry import Role
from robochoc.formats.diagnostics import on_one_line, shortened, suggestion
from robochoc.formats.names import is_name
from robochoc.system.errors import RobochocError

_MOST_NAMED = 10


class InvalidNameError(RobochocError, ValueError):
    """The name is invalid or reserved."""


class NotEnrolledError(RobochocError, LookupError):
    """The name is not enrolled."""


def describe_enrolled(name: str, members: Collection[str]) -> str:
    """Return the enrolled names as text, with the name most similar to `name`."""
    known = sorted(known for known in members if known != MASTER)
    if not known:
        return "there are no enrolled names; run: robochoc authority enrol NAME"
    hint = suggestion(name, known, "names")
    near = f"{hint} " if hint.startswith("did") else ""
    more = len(known) - _MOST_NAMED
    return f"{near}enrolled: {', '.join(known[:_MOST_NAMED])}" + (f" and {more} more" if more > 0 else "")


def check_member_name(name: str, role: Role = Role.ROBOT, hosts: Sequence[str] = ()) -> None:
    """Raise `InvalidNameError` if `name` is not allowed for `role`, or a master has no hosts."""
    shown = on_one_line(shortened(name))
    if not is_name(name):
        raise InvalidNameError(
            f"'{shown}' is not a valid name of a robot: use a letter, then letters, digits, '_' and '.'"
        )
    if len(name) > LONGEST_NAME:
        raise InvalidNameError(f"'{shown}' is too long: use at most {LONGEST_NAME} characters")
    if name.upper() == MASTER:
        raise InvalidNameError(
            f"the name {MASTER} is reserved for the master on the Authority's machine, which needs no token;"
            " choose another name"
        )
    if role == Role.MASTER and not hosts:
        raise InvalidNameError(f"{name} is a standby master, and robots check its address: add --host NAME")
    if hosts and role != Role.MASTER:
        raise InvalidNameError(f"{name} has the role {role}, and only a master has hosts: remove --host")
