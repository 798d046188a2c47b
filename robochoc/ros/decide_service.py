"""The service `decide`: a request names a team and changes of its problem; the answer is what the team decides.

The definitions are those of `robochoc_msgs/srv/Decide` (docs/ros2). Requests come from outside: whatever is
wrong with one is answered in a sentence.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgspec

from robochoc.formats.diagnostics import InvalidInputError, on_one_line, shortened
from robochoc.formats.result import result_json
from robochoc.model.change import apply_changes
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import AddValue, Change, RemoveAgent, RemoveValue, Team
from robochoc.model.team_edits import ChangeError
from robochoc.robots.sink import Fields
from robochoc.run.options import Options
from robochoc.system.decode_errors import describe_decode_error
from robochoc.system.errors import RobochocError

DECIDE, TRIGGER = "robochoc_msgs/Decide", "std_srvs/Trigger"
"""The types of services that are offered."""
CHANGES_MAX = 1_000
CHANGES_CHARACTERS_MAX = 64 * 1024
REFUSAL_CHARACTERS_MAX = 1_000
"""A refusal may repeat what was asked, which may be long."""
RESULT_CHARACTERS_MAX = 128 * 1024
"""A longer result is left out of the answer."""

Solve = Callable[[Team, Options], Outcome]


class RequestError(RobochocError, ValueError):
    """The request cannot be carried out. The message says why."""


class _Value(msgspec.Struct, forbid_unknown_fields=True):
    variable: str
    value: int


class _Named(msgspec.Struct, forbid_unknown_fields=True):
    name: str


class _Change(msgspec.Struct, forbid_unknown_fields=True):
    remove_value: _Value | None = None
    add_value: _Value | None = None
    remove_agent: _Named | None = None


class DecideService:
    """Answers requests about `teams`, by their names, one after the other.

    Args:
        teams: The teams, as their files have them.
        solve: Lets a team decide.
        options: How; its `timeout` is the longest time for one request, in seconds.
    """

    def __init__(self, teams: Sequence[Team], solve: Solve, options: Options) -> None:
        self._teams = {team.name: team for team in teams}
        self._solve = solve
        self._options = options

    def decide(self, fields: Fields) -> dict[str, Any]:
        """Return the answer to a request `robochoc_msgs/Decide_Request`. Only `SystemExit` is raised."""
        try:
            team = self._team(_text(fields, "team"))
            options = replace(self._options, timeout=self._timeout_s(fields.get("timeout", 0.0)))
            changed = apply_changes(team, _changes(_text(fields, "changes")))
            return _answer(self._solve(changed, options))
        except (RequestError, ChangeError, InvalidInputError) as wrong:  # the last: a change leaves no team
            return refusal(str(wrong))
        except Exception as error:  # noqa: BLE001 - each request is answered
            return refusal(f"{type(error).__name__}: {error}")

    def trigger(self, team: str) -> dict[str, Any]:
        """Return the answer to a request `std_srvs/Trigger_Request` about the team of that name."""
        answer = self.decide({"team": team})
        told = {name: answer[name] for name in ("verdict", "cost") if answer.get(name)}
        if answer["success"]:
            told["assignment"] = dict(zip(answer["variables"], answer["values"], strict=True))
        message = msgspec.json.encode(told).decode() if told else answer["message"]
        return {"success": answer["success"], "message": message}

    def _team(self, name: str) -> Team:
        if not name and len(self._teams) == 1:
            return next(iter(self._teams.values()))
        if name not in self._teams:
            known = shortened(", ".join(self._teams))
            raise RequestError(f"no team has the name {shortened(name)!r}; known are {known}")
        return self._teams[name]

    def _timeout_s(self, asked: object) -> float | None:
        if isinstance(asked, bool) or not isinstance(asked, int | float) or not 0 <= asked < math.inf:
            raise RequestError(f"timeout must be seconds, or 0 for the longest, is {_shown(asked)}")
        return min((one for one in (asked, self._options.timeout) if one), default=None)


def _text(fields: Fields, name: str) -> str:
    """Return the text of a field; empty if it is not given. Raises `RequestError`."""
    value = fields.get(name, "")
    if not isinstance(value, str):
        raise RequestError(f"{name} must be text, is {_shown(value)}")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        half = f"character {error.start + 1:,} is half of a pair (U+{ord(value[error.start]):04X})"
        raise RequestError(f"{name} must be text that UTF-8 can hold, and {half}") from None
    return value


def _shown(value: object) -> str:
    """Return a value that is wrong, short enough for a message."""
    try:
        return shortened(reprlib.repr(value))
    except Exception:  # noqa: BLE001 - a whole number may have too many digits to be written
        return f"a {type(value).__name__}"


def refusal(why: str) -> dict[str, Any]:
    """Return the answer that nothing was decided, and why."""
    told = on_one_line(why)
    most = REFUSAL_CHARACTERS_MAX
    return {"success": False, "message": told if len(told) <= most else f"{told[: most - 3]}..."}


def _answer(outcome: Outcome) -> dict[str, Any]:
    decided = outcome.verdict in (Verdict.SOLUTION, Verdict.OPTIMAL)
    values = dict(sorted(outcome.assignment.items())) if decided else {}
    result = result_json(outcome).decode()
    epochs = len(outcome.epochs) or 1
    told = f"{outcome.verdict.value}, {epochs} epoch{'s' * (epochs != 1)}"
    return {
        "success": decided,
        "message": on_one_line(f"{told}: {outcome.reason}" if outcome.reason else told),
        "verdict": outcome.verdict.value,
        "cost": "" if outcome.cost is None or not decided else str(outcome.cost),
        "variables": [*values],
        "values": [*values.values()],
        "withdrawn": [*outcome.withdrawn],
        "result": result if len(result) <= RESULT_CHARACTERS_MAX else "",
    }


def _changes(text: str) -> list[Change]:
    """Return the changes that a request asks for, as JSON. Raises `RequestError`."""
    if not text.strip():
        return []
    if len(text) > CHANGES_CHARACTERS_MAX:
        raise RequestError(f"changes have {len(text):,} characters, and at most {CHANGES_CHARACTERS_MAX:,} are read")
    try:
        found = msgspec.json.decode(text, type=list[_Change])
    except msgspec.DecodeError as error:
        raise RequestError(f"changes: {describe_decode_error(error, list[_Change])}") from error
    except RecursionError as error:
        raise RequestError("changes are nested too deeply") from error
    if len(found) > CHANGES_MAX:
        raise RequestError(f"there are {len(found):,} changes, and at most {CHANGES_MAX:,} are taken")
    return [*_each(found)]


def _each(found: Sequence[_Change]) -> Iterator[Change]:
    for number, one in enumerate(found, 1):
        match one:
            case _Change(remove_value=_Value() as value, add_value=None, remove_agent=None):
                yield RemoveValue(value.variable, value.value)
            case _Change(remove_value=None, add_value=_Value() as value, remove_agent=None):
                yield AddValue(value.variable, value.value)
            case _Change(remove_value=None, add_value=None, remove_agent=_Named() as named):
                yield RemoveAgent(named.name)
            case _:
                raise RequestError(f"change {number} must be one of remove_value, add_value and remove_agent")


SERVICES: Mapping[str, str] = {DECIDE: "robochoc_msgs/srv/Decide", TRIGGER: "std_srvs/srv/Trigger"}
"""Their names as ROS 2 writes them."""
