"""Entry points of installed packages, such as protocols and filters, which may be third-party code."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

from robochoc.system.entry_points import EntryPoint, entry_points
from robochoc.system.termination import Terminated

Fault = Callable[[object], str]
"""A function that returns the reason why a loaded object cannot be used; empty if it can be used."""


class Loaded(NamedTuple):
    """The object to which an entry point refers, or the reason why the object cannot be used."""

    what: object
    broken: str


def installed_entry_points(group: str) -> Sequence[EntryPoint]:
    """Return all entry points in `group`, unordered.

    Reading the entry points of all packages takes as long as a small run. They are read again only if a folder on
    `sys.path` has changed, since then a package may have been installed or removed.
    """
    return _read(group, tuple((place, _changed_ns(place)) for place in sys.path))


@lru_cache(maxsize=8)
def _read(group: str, _path: tuple[tuple[str, int], ...]) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group))


def _changed_ns(place: str) -> int:
    try:
        return os.stat(place or os.curdir).st_mtime_ns  # noqa: PTH116 - called often, for names in sys.path
    except OSError:
        return 0


def entry_point_names(group: str) -> tuple[str, ...]:
    """Return the names of all entry points in `group`, sorted."""
    return tuple(sorted({entry.name for entry in installed_entry_points(group)}))


def all_entry_points(group: str) -> list[tuple[EntryPoint, list[EntryPoint]]]:
    """Return all entry points, sorted by name, each with all entry points of the same name."""
    found = sorted(installed_entry_points(group), key=lambda entry: entry.name)
    return [(entry, [other for other in found if other.name == entry.name]) for entry in found]


def entry_points_named(group: str, name: str) -> list[EntryPoint]:
    """Return all entry points with this name. There are several if packages conflict."""
    return [entry for entry in installed_entry_points(group) if entry.name == name]


def not_installed_message(group: str, kind: str, name: str, *, also: Sequence[str] = (), listed_by: str = "") -> str:
    """Return an error message for an unknown name, with the known names and the most similar ones.

    Args:
        group: The group of entry points.
        kind: A noun for the names, such as `protocol`.
        name: The unknown name.
        also: Known names that are not entry points.
        listed_by: The command that lists the names, for the case that they are too many for a message.
    """
    import difflib  # noqa: PLC0415 - start-up: only needed for errors

    names = sorted([*entry_point_names(group), *also])
    near = difflib.get_close_matches(name.lower(), names, 3 if listed_by else 1)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    if listed_by:
        return f"no {kind} {name!r} is installed{hint or ';'} {listed_by!r} lists them"
    return f"no {kind} {name!r} is installed, only: {', '.join(names) or 'none'}{hint}"


def load_entry_point(entry: EntryPoint, namesakes: Sequence[EntryPoint], fault: Fault) -> Loaded:
    """Load the object of `entry`. Errors are returned, because a broken package must not hide the others."""
    if len(namesakes) > 1:
        places = " and ".join(sorted(f"{one.value} ({one.dist.name if one.dist else 'unknown'})" for one in namesakes))
        return Loaded(None, f"is offered by several packages: {places}; uninstall all but one")
    try:
        found = entry.load()
    except Terminated:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 - see above
        return Loaded(None, f"cannot be imported: {type(error).__name__}: {error}{_after_an_update(entry, error)}")
    broken = fault(found)
    return Loaded(None if broken else found, broken)


def _after_an_update(entry: EntryPoint, error: BaseException) -> str:
    """Return a hint for the case that a module of robochoc itself is missing."""
    ours = entry.value.startswith("robochoc.") and isinstance(error, ModuleNotFoundError)
    return "; robochoc has changed since it was installed: run make demo, or pip install -e . again" if ours else ""
