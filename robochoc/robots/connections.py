"""Sinks and sources by name, as installed packages offer them: `mcap:run.mcap`, `rosbridge://localhost:9090`, `rospy`.

They are found under the entry point groups `robochoc.sinks` and `robochoc.sources`, and are called with what follows
the name. The caller closes what it has opened.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import cast

from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.sink import Sink, SinkError
from robochoc.robots.source import Source, SourceError
from robochoc.system.entry_points import EntryPoint
from robochoc.system.files import resolved
from robochoc.system.installed import entry_points_named, load_entry_point, not_installed_message
from robochoc.system.termination import Terminated

SINKS, SOURCES = "robochoc.sinks", "robochoc.sources"

_ENDINGS = {".mcap": "mcap", ".bag": "rosbag", ".db3": "rosbag2"}
"""Files that may stand alone, without the name of their format."""


class UnknownSinkError(SinkError):
    """No sink of that name is installed, or it cannot be used. The message says what to install or write instead."""


class UnknownSourceError(SourceError):
    """No source of that name is installed, or it cannot be used. The message says what to install or write instead."""


def open_sink(text: str) -> Sink:
    """Return the sink that `text` names. Raises `UnknownSinkError`, and `SinkError` if it cannot be opened."""
    name, place = _parts(text)
    return cast("type[Sink]", _offered(SINKS, "sink", name, Sink, UnknownSinkError))(place)


def open_source(text: str) -> Source:
    """Return the source that `text` names. Raises `UnknownSourceError`, and `SourceError` if it cannot be opened."""
    name, place = _parts(text)
    return cast("type[Source]", _offered(SOURCES, "source", name, Source, UnknownSourceError))(place)


def place_of(text: str) -> Path | str:
    """Return the resolved file of a recording, else `text` itself.

    Raises:
        OSError: Symbolic links form a circle.
    """
    name, place = _parts(text)
    return resolved(Path(place)) if place and name in _ENDINGS.values() else text


def _parts(text: str) -> tuple[str, str]:
    """Return the name and what follows it: `rosbridge` and `localhost:9090` for `rosbridge://localhost:9090`."""
    name, colon, place = text.partition(":")
    alone = next((kind for ending, kind in _ENDINGS.items() if text.endswith(ending)), None)
    if alone and (not colon or "/" in name):
        return alone, text
    return name, place.removeprefix("//")


def _offered(group: str, kind: str, name: str, base: type, wrong: type[Exception]) -> object:
    """Return the class that is installed as `name`. Raises `wrong`."""
    namesakes = entry_points_named(group, name)
    if not namesakes:
        hint = "" if name else f"; a {kind} is written NAME:PLACE, such as mcap:run.mcap"
        if "?" in name:
            hint = f"; options follow a colon: {name.replace('?', ':?', 1)}"
        also = ("flight",) if group == SOURCES else ()  # the simulated one
        raise wrong(on_one_line(not_installed_message(group, kind, name, also=also) + hint))
    entry = namesakes[0]
    lacking = _lacking(entry) if len(namesakes) == 1 else ""
    if lacking:
        raise wrong(on_one_line(lacking))
    found = load_entry_point(entry, namesakes, lambda what: _fault(what, base))
    if found.broken:
        raise wrong(on_one_line(f"{entry.value}, installed as {kind} {name!r}, {found.broken}"))
    return found.what


def lacking_for(name: str) -> str:
    """Return the missing packages of the sink `name`, as advice; empty if it can be used."""
    namesakes = entry_points_named(SINKS, name)
    return on_one_line(_lacking(namesakes[0])) if namesakes else ""


def _fault(found: object, base: type) -> str:
    return "" if isinstance(found, type) and issubclass(found, base) else f"is no {base.__name__}"


def _lacking(entry: EntryPoint) -> str:
    """Return advice on a missing extra of the package of `entry`; else empty."""
    try:
        entry.load()
    except ModuleNotFoundError as error:
        extras = entry.dist.metadata.get_all("Provides-Extra") or [] if entry.dist else []
        extra = next((one for one in extras if _normalised(one) == _normalised(entry.name)), "")
        if entry.dist and extra:
            wanted = f"{entry.dist.name}[{extra}]"
            return f"{entry.name} needs {error.name}, which is not installed: pip install '{wanted}'"
    except Terminated:
        raise
    except (Exception, SystemExit):  # noqa: BLE001 - raised when it is loaded once more
        return ""
    return ""


def _normalised(extra: str) -> str:
    """Return the one spelling of an extra's name; metadata may have another than `pyproject.toml`."""
    return re.sub(r"[-_.]+", "-", extra).lower()
