"""Opens sinks and sources in installed packages by name: `mcap:run.mcap`, `rosbridge://localhost:9090`, `rospy`.

Sinks and sources are found in the entry point groups `robochoc.sinks` and `robochoc.sources`, and called with the text
after the name. The caller closes them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import cast

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.echo_sink import ECHO, EchoSink
from robochoc.robots.sink import Sink, SinkError
from robochoc.robots.source import Source, SourceError
from robochoc.system.entry_points import EntryPoint
from robochoc.system.files import resolved
from robochoc.system.installed import entry_points_named, load_entry_point, not_installed_message
from robochoc.system.termination import Terminated

SINKS, SOURCES = "robochoc.sinks", "robochoc.sources"

_ENDINGS = {".mcap": "mcap", ".bag": "rosbag", ".db3": "rosbag2"}
"""The extensions of files that may be given without the name of their format."""


class UnknownSinkError(SinkError):
    """No sink with this name is installed, or it cannot be used. The message has the package to install, or a hint."""


class UnknownSourceError(SourceError):
    """No source of this name is installed, or it cannot be used. The message has the package to install, or a hint."""


def open_sink(text: str) -> Sink:
    """Return the sink named by `text`. Raises `UnknownSinkError`, and `SinkError` if it cannot be opened."""
    name, place = _parts(text)
    if name == ECHO:
        return EchoSink(place)
    return cast("type[Sink]", _load_class(SINKS, "sink", name, Sink, UnknownSinkError))(place)


def open_source(text: str) -> Source:
    """Return the source named by `text`. Raises `UnknownSourceError`, and `SourceError` if it cannot be opened."""
    name, place = _parts(text)
    return cast("type[Source]", _load_class(SOURCES, "source", name, Source, UnknownSourceError))(place)


def place_of(text: str) -> Path | str:
    """Return the resolved file of a recording, else `text` itself.

    Raises:
        OSError: Symbolic links form a circle.
    """
    name, place = _parts(text)
    return resolved(Path(place)) if place and name in _ENDINGS.values() else text


def _parts(text: str) -> tuple[str, str]:
    """Split `rosbridge://localhost:9090` into the name `rosbridge` and the place `localhost:9090`."""
    name, colon, place = text.partition(":")
    alone = next((kind for ending, kind in _ENDINGS.items() if text.endswith(ending)), None)
    if alone and (not colon or "/" in name):
        return alone, text
    return name, place.removeprefix("//")


def _load_class(group: str, kind: str, name: str, base: type, error_type: type[Exception]) -> object:
    """Return the class installed as `name`. Raises `error_type`."""
    entries = entry_points_named(group, name)
    if not entries:
        hint = "" if name else f"; a {kind} is written NAME:PLACE, such as mcap:run.mcap"
        if "?" in name:
            hint = f"; options follow a colon: {name.replace('?', ':?', 1)}"
        also = ("flight",) if group == SOURCES else (ECHO,)  # not entry points
        raise error_type(on_one_line(not_installed_message(group, kind, name, also=also) + hint))
    entry = entries[0]
    missing = _missing_extra(entry) if len(entries) == 1 else ""
    if missing:
        raise error_type(on_one_line(missing))
    found = load_entry_point(entry, entries, lambda what: _fault(what, base))
    if found.broken:
        raise error_type(on_one_line(f"{entry.value}, installed as {kind} {name!r}, {found.broken}"))
    return found.what


def missing_packages_of(name: str) -> str:
    """Return advice on the missing packages for the sink `name`; empty if the sink can be used."""
    entries = entry_points_named(SINKS, name)
    return on_one_line(_missing_extra(entries[0])) if entries else ""


def _fault(found: object, base: type) -> str:
    return "" if isinstance(found, type) and issubclass(found, base) else f"is not a {base.__name__}"


def _missing_extra(entry: EntryPoint) -> str:
    """Return an error text for a missing extra of the package that has `entry`; empty if nothing is missing."""
    try:
        entry.load()
    except ModuleNotFoundError as error:
        extras = entry.dist.metadata.get_all("Provides-Extra") or [] if entry.dist else []
        extra = next((one for one in extras if _normalised(one) == _normalised(entry.name)), "")
        if entry.dist and extra:
            package = f"{entry.dist.name}[{extra}]"
            return f"{entry.name} needs {error.name}, which is not installed: pip install '{package}'"
    except Terminated:
        raise
    except (Exception, SystemExit):  # noqa: BLE001 - raised when the entry is loaded again
        return ""
    return ""


def _normalised(extra: str) -> str:
    """Return the normalised name of an extra, since metadata and `pyproject.toml` may spell it differently."""
    return re.sub(r"[-_.]+", "-", extra).lower()
