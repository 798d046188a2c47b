"""Read a priority order from a text file: one robot's name per line, highest priority first; `#` starts a comment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from robochoc.formats.diagnostics import DiagnosticCollector, invalid_input, shortened, suggestion
from robochoc.model.original_names import robots_called
from robochoc.model.problem import Team

MAX_BYTES = 1024 * 1024
_MISSING_SHOWN = 10


def read_order(path: Path, team: Team, names: Mapping[str, str] = {}) -> tuple[str, ...]:
    """Return the order of all robots in `team`, from the file `path`. The file may use the robots' original `names`.

    Raises:
        InvalidInputError: with every error in the file.
    """
    report = DiagnosticCollector(str(path))
    lines = _text(path).splitlines()
    known = robots_called(team, names)
    places: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        if name not in known:
            hint = suggestion(name, list(known), "robots")
            report.add(number, f"'{shortened(name)}' is not a robot of {team.name}", hint)
        elif known[name] in places:
            first = places[known[name]]
            report.add(number, f"'{name}' is listed twice", f"list each robot once; it is in line {first} already")
        else:
            places[known[name]] = number
    missing = [name for name in team.order if name not in places]
    if missing:
        many = len(missing) > 1
        shown = " ".join(missing[:_MISSING_SHOWN]) + (" ..." if len(missing) > _MISSING_SHOWN else "")
        message = f"{len(missing)} robot{'s are' if many else ' is'} missing: {shown}"
        report.add(max(1, len(lines)), message, f"add {'them' if many else 'it'}, one name per line")
    report.finish()
    return tuple(places)


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise invalid_input(path, f"cannot be read: {reason}", "check the path and its permissions") from None
    if len(content) > MAX_BYTES:
        raise invalid_input(path, f"is larger than {MAX_BYTES // 2**20} MiB", "write one robot's name per line")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise invalid_input(path, "is not UTF-8", "use a text file with one robot's name per line") from None
