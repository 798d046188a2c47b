"""Requests of users about tasks, as JSON (rmf_api_msgs): a new task, or the end of one. Requests are untrusted."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec

from robochoc.formats.diagnostics import on_one_line
from robochoc.ros.rmf.messages import TaskStateUpdate
from robochoc.system.decode_errors import describe_decode_error
from robochoc.system.errors import RobochocError

INVALID_REQUEST, NOT_FEASIBLE, NO_BIDS, OUT_OF_ORDER = 5, 9, 10, 14
"""The codes of errors, as in RMF."""
DETAIL_MAX = 500
"""The maximum length of an error's text, in characters."""
_Category = Annotated[str, msgspec.Meta(max_length=100, pattern=r"^[A-Za-z0-9_.-]+$")]
"""The name of a category, which is part of the ids of tasks."""


class RequestError(RobochocError, ValueError):
    """The request is invalid. The message has the reason."""


class TaskRequest(msgspec.Struct, frozen=True):
    """The description of a task: its category, such as `patrol`, and a description that depends on the category.

    Attributes:
        category: The category.
        description: The description.
        fleet_name: The only fleet that may do the task; None: any fleet.
        unix_millis_earliest_start_time: The earliest start, in milliseconds since 1970.
    """

    category: _Category
    description: Any
    fleet_name: str | None = None
    unix_millis_earliest_start_time: int = 0


class _Request(msgspec.Struct, frozen=True):
    type: str
    request: msgspec.Raw = msgspec.Raw()
    task_id: str = ""


class NewTask(msgspec.Struct, frozen=True):
    """A request for a new task: its description, as received and decoded."""

    text: str
    task: TaskRequest


class CancelTask(msgspec.Struct, frozen=True):
    """A request to end the task `task_id`."""

    task_id: str


def read_request(text: str) -> NewTask | CancelTask | None:
    """Return a user's request; None if it is of another type, which other nodes answer. Raises `RequestError`."""
    found: _Request = _decoded(text, _Request)
    match found.type:
        case "dispatch_task_request":
            request = bytes(found.request).decode() or "null"
            return NewTask(request, read_task(request))
        case "cancel_task_request":
            return CancelTask(found.task_id)
        case _:
            return None


def read_task(text: str) -> TaskRequest:
    """Return the description of a task. Raises `RequestError`."""
    found: TaskRequest = _decoded(text, TaskRequest)
    return found


def error_json(code: int, category: str, detail: str) -> str:
    """Return an error as JSON (the schema `error` of rmf_api_msgs)."""
    return _text({"code": code, "category": category, "detail": on_one_line(detail[:DETAIL_MAX])})


def failure_json(code: int, category: str, detail: str) -> str:
    """Return the answer to a request that is refused, as JSON."""
    error = {"code": code, "category": category, "detail": on_one_line(detail[:DETAIL_MAX])}
    return _text({"success": False, "errors": [error]})


def success_json(state: dict[str, Any] | None = None) -> str:
    """Return the answer to a request that is accepted, as JSON, with the state of a new task."""
    return _text({"success": True} | ({} if state is None else {"state": state}))


def state_json(
    task_id: str, task: TaskRequest, status: str, assigned_to: tuple[str, str] | None = None, **more: object
) -> dict[str, Any]:
    """Return the state of a task (the schema `task_state` of rmf_api_msgs).

    Args:
        task_id: The task.
        task: Its description.
        status: Its status, such as `queued`, `underway` or `completed`.
        assigned_to: The fleet and the robot.
        **more: Further entries, such as `unix_millis_finish_time`.
    """
    state: dict[str, Any] = {
        "booking": {"id": task_id, "unix_millis_earliest_start_time": task.unix_millis_earliest_start_time},
        "category": task.category,
        "detail": task.description,
        "status": status,
        **more,
    }
    if assigned_to is not None:
        state["assigned_to"] = {"group": assigned_to[0], "name": assigned_to[1]}
    return state


def task_state_update(state: dict[str, Any]) -> TaskStateUpdate:
    """Return the message with the state of a task (the schema `task_state_update` of rmf_api_msgs)."""
    return TaskStateUpdate(_text({"type": "task_state_update", "data": state}))


def _text(value: object) -> str:
    return msgspec.json.encode(value).decode()


def _decoded(text: str, kind: type[Any]) -> Any:  # noqa: ANN401 - an object of `kind`
    try:
        return msgspec.json.decode(text, type=kind)
    except msgspec.DecodeError as error:
        raise RequestError(describe_decode_error(error, kind)) from None
    except RecursionError:
        raise RequestError("it is nested too deeply") from None
    except UnicodeError:
        raise RequestError("it is not UTF-8") from None
