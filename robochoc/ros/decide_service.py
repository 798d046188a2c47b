"""The service `decide`: a request has a team's name and changes to its problem; the answer is the team's decision.

Its definition is `robochoc_msgs/srv/Decide` (docs/ros2). Requests are untrusted: an invalid request is answered with an
error message.
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
"""The types of the offered services."""
CHANGES_MAX = 1_000
CHANGES_CHARACTERS_MAX = 64 * 1024
REFUSAL_CHARACTERS_MAX = 1_000
"""The maximum length of an error message, in characters: it may quote the request, which may be long."""
RESULT_CHARACTERS_MAX = 128 * 1024
"""The maximum length of a result, in characters. Longer results are omitted from the answer."""

Solve = Callable[[Team, Options], Outcome]


class RequestError(RobochocError, ValueError):
    """The request is invalid. The message gives the reason."""


class _VariableValue(msgspec.Struct, forbid_unknown_fields=True):
    variable: str
    value: int


class _AgentName(msgspec.Struct, forbid_unknown_fields=True):
    name: str


class _ChangeRequest(msgspec.Struct, forbid_unknown_fields=True):
    remove_value: _VariableValue | None = None
    add_value: _VariableValue | None = None
    remove_agent: _AgentName | None = None


class DecideService:
    """Answers requests about `teams`, one at a time.

    Args:
        teams: The teams from their files.
        solve: The function that solves a team's problem.
        options: The options for `solve`. Their `timeout` is the maximum time for one request, in seconds.
    """

    def __init__(self, teams: Sequence[Team], solve: Solve, options: Options) -> None:
        self._teams = {team.name: team for team in teams}
        self._solve = solve
        self._options = options

    def decide(self, fields: Fields) -> dict[str, Any]:
        """Return the answer to a `robochoc_msgs/Decide_Request`. Only `SystemExit` is raised."""
        try:
            team = self._team(_text(fields, "team"))
            options = replace(self._options, timeout=self._timeout_s(fields.get("timeout", 0.0)))
            changed = apply_changes(team, _changes(_text(fields, "changes")))
            return _answer(self._solve(changed, options))
        except (RequestError, ChangeError, InvalidInputError) as error:  # InvalidInputError: no team remains
            return refusal(str(error))
        except Exception as error:  # noqa: BLE001 - each request is answered
            return refusal(f"{type(error).__name__}: {error}")

    def trigger(self, team: str) -> dict[str, Any]:
        """Return the answer to a `std_srvs/Trigger_Request` about the team with this name."""
        answer = self.decide({"team": team})
        result = {name: answer[name] for name in ("verdict", "cost") if answer.get(name)}
        if answer["success"]:
            result["assignment"] = dict(zip(answer["variables"], answer["values"], strict=True))
        message = msgspec.json.encode(result).decode() if result else answer["message"]
        return {"success": answer["success"], "message": message}

    def _team(self, name: str) -> Team:
        if not name and len(self._teams) == 1:
            return next(iter(self._teams.values()))
        if name not in self._teams:
            known = shortened(", ".join(self._teams))
            raise RequestError(f"unknown team {shortened(name)!r}; known teams: {known}")
        return self._teams[name]

    def _timeout_s(self, requested: object) -> float | None:
        if isinstance(requested, bool) or not isinstance(requested, int | float) or not 0 <= requested < math.inf:
            raise RequestError(f"timeout is {_shown(requested)}: it must be seconds, or 0 for the longest time")
        return min((limit for limit in (requested, self._options.timeout) if limit), default=None)


def _text(fields: Fields, name: str) -> str:
    """Return the text in the field `name`; empty if the field is missing. Raises `RequestError`."""
    value = fields.get(name, "")
    if not isinstance(value, str):
        raise RequestError(f"{name} is {_shown(value)}: it must be text")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        half = f"character {error.start + 1:,} is half of a pair (U+{ord(value[error.start]):04X})"
        raise RequestError(f"{name} must be text that UTF-8 can encode: {half}") from None
    return value


def _shown(value: object) -> str:
    """Return an invalid value as short text for an error message."""
    try:
        return shortened(reprlib.repr(value))
    except Exception:  # noqa: BLE001 - an integer may have too many digits for `repr`
        return f"a {type(value).__name__}"


def refusal(why: str) -> dict[str, Any]:
    """Return the answer that refuses a request for the reason `why`."""
    message = on_one_line(why)
    most = REFUSAL_CHARACTERS_MAX
    return {"success": False, "message": message if len(message) <= most else f"{message[: most - 3]}..."}


def _answer(outcome: Outcome) -> dict[str, Any]:
    decided = outcome.verdict in (Verdict.SOLUTION, Verdict.OPTIMAL)
    values = dict(sorted(outcome.assignment.items())) if decided else {}
    result = result_json(outcome).decode()
    epochs = len(outcome.epochs) or 1
    summary = f"{outcome.verdict.value}, {epochs} epoch{'s' * (epochs != 1)}"
    return {
        "success": decided,
        "message": on_one_line(f"{summary}: {outcome.reason}" if outcome.reason else summary),
        "verdict": outcome.verdict.value,
        "cost": "" if outcome.cost is None or not decided else str(outcome.cost),
        "variables": [*values],
        "values": [*values.values()],
        "withdrawn": [*outcome.withdrawn],
        "result": result if len(result) <= RESULT_CHARACTERS_MAX else "",
    }


def _changes(text: str) -> list[Change]:
    """Parse the changes in a request, given as JSON. Raises `RequestError`."""
    if not text.strip():
        return []
    if len(text) > CHANGES_CHARACTERS_MAX:
        raise RequestError(f"changes have {len(text):,} characters: at most {CHANGES_CHARACTERS_MAX:,} are accepted")
    try:
        found = msgspec.json.decode(text, type=list[_ChangeRequest])
    except msgspec.DecodeError as error:
        raise RequestError(f"changes: {describe_decode_error(error, list[_ChangeRequest])}") from error
    except RecursionError as error:
        raise RequestError("changes are nested too deeply") from error
    if len(found) > CHANGES_MAX:
        raise RequestError(f"there are {len(found):,} changes: at most {CHANGES_MAX:,} are accepted")
    return [*_as_changes(found)]


def _as_changes(found: Sequence[_ChangeRequest]) -> Iterator[Change]:
    for number, change in enumerate(found, 1):
        match change:
            case _ChangeRequest(remove_value=_VariableValue() as value, add_value=None, remove_agent=None):
                yield RemoveValue(value.variable, value.value)
            case _ChangeRequest(remove_value=None, add_value=_VariableValue() as value, remove_agent=None):
                yield AddValue(value.variable, value.value)
            case _ChangeRequest(remove_value=None, add_value=None, remove_agent=_AgentName() as named):
                yield RemoveAgent(named.name)
            case _:
                raise RequestError(f"change {number} must be one of remove_value, add_value and remove_agent")


SERVICES: Mapping[str, str] = {DECIDE: "robochoc_msgs/srv/Decide", TRIGGER: "std_srvs/srv/Trigger"}
"""The types of the services, in the spelling of ROS 2."""
