"""`robochoc rmf`: dispatches tasks to RMF fleets, bids for tasks of RMF's dispatcher, and requests tasks."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import click

from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.ros_setup import ros_errors_as_failures
from robochoc.cli.options.value_types import Name, Number, ProtocolName, WholeNumber
from robochoc.cli.reports.failures import LIMIT, USAGE, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.ros.rmf.exchange import Exchange
    from robochoc.ros.rmf.messages import Message

_SLICE_S = 0.1
"""The interval at which signals are handled and times are checked, in seconds."""
_REPEAT_S = 1.0
_ros = click.option(
    "--ros",
    "place",
    default="dds",
    metavar="PLACE",
    help="dds, dds:DOMAIN?partition=NAME, rmw_zenoh://HOST:PORT or rosbridge://HOST:PORT.  "
    "[default: dds, in the domain of ROS_DOMAIN_ID]",
)
_protocol = click.option(
    "--protocol", type=ProtocolName(), default="auto", show_default=True, help="Protocol for costs, as for 'solve'."
)


class _Core(Protocol):
    """A dispatcher or a bidder: messages and the time go in, messages come out."""

    def receive(self, message: Message, now_s: float) -> None: ...
    def tick(self, now_s: float) -> None: ...
    def drain(self) -> list[Message]: ...


@click.group()
def rmf() -> None:
    """Exchange tasks with Open-RMF, without an installed ROS (documentation, page Open-RMF).

    \b
    robochoc rmf dispatch                   # instead of RMF's dispatcher: allocate tasks to fleets
    robochoc rmf bid fleet.yaml             # instead of an RMF fleet adapter: robots bid for tasks
    robochoc rmf request patrol pantry coe  # as RMF's scripts do
    """  # noqa: D301 - \\b keeps click from wrapping the lines


@rmf.command(short_help="Allocate tasks to RMF fleets, several at a time.")
@_ros
@_protocol
@click.option(
    "--window",
    type=Number(0, min_open=True),
    default=2.0,
    show_default=True,
    metavar="SECONDS",
    help="Longest wait for bids for a task; doubled after each failure, up to 8 times.",
)
@click.option("--by-finish", is_flag=True, help="Compare bids by finish times.  [default: by added costs]")
@click.option("--batch", type=WholeNumber(1, 100), default=10, show_default=True, metavar="N", help="Tasks in a round.")
@click.option("--tasks", type=WholeNumber(1), metavar="N", help="End after N tasks.  [default: at Ctrl-C]")
def dispatch(place: str, protocol: str, window: float, batch: int, tasks: int | None, *, by_finish: bool) -> None:
    """Dispatch tasks to RMF fleets. Start this instead of RMF's own dispatcher, not beside it.

    Requests (task_api_requests) are collected, fleet adapters bid for each task, and the tasks are allocated together:
    as many as possible, each fleet one at a time, at the lowest added cost. Each finished task is a line of JSON.

    \b
    robochoc rmf dispatch --ros dds:0
    robochoc rmf dispatch --ros rosbridge://localhost:9090 --by-finish
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.ros.rmf import messages as m
    from robochoc.ros.rmf.allocation import allocate
    from robochoc.ros.rmf.dispatcher import Dispatcher
    from robochoc.ros.rmf.records import Settings

    with errors_as_failures(f"--protocol {protocol}, tried on two tasks and two fleets"):
        allocate({"a": {"x": 1, "y": 2}, "b": {"x": 2, "y": 1}}, protocol=protocol)
    prefix = f"{secrets.token_hex(3)}-"
    settings = Settings(time_window_s=window, batch=batch, by_finish=by_finish)
    dispatcher = Dispatcher(
        prefix,
        lambda costs, overdue: allocate(costs, overdue, protocol=protocol),
        settings,
        epoch_ns=_epoch_ns(),
    )
    finished = 0

    def report() -> bool:
        nonlocal finished
        for state in dispatcher.drain_finished():
            finished += 1
            one = state.assignment
            _print_line(
                task=state.task_id,
                status=m.TaskStatus(state.status).name.lower(),
                fleet=one.fleet_name,
                robot=one.expected_robot_name,
                errors=state.errors,
            )
        return tasks is not None and finished >= tasks

    sends = (m.ApiResponse, m.BidNotice, m.DispatchCommand, m.DispatchStates, m.TaskStateUpdate)
    with ros_errors_as_failures(), _opened(place, sends, (m.ApiRequest, m.BidResponse, m.DispatchAck)) as exchange:
        click.echo(f"{place}: dispatching", err=True)
        with errors_as_failures(f"--protocol {protocol}"):
            _run(exchange, dispatcher, report)


@rmf.command(short_help="Bid for RMF's tasks with a fleet of robots.")
@click.argument("fleet", type=InputPath(), metavar="FLEET.yaml")
@_ros
@_protocol
@click.option("--tasks", type=WholeNumber(1), metavar="N", help="End after N completed tasks.  [default: at Ctrl-C]")
@invalid_input_fails
def bid(fleet: Path, place: str, protocol: str, tasks: int | None) -> None:
    """Bid for the tasks of RMF's dispatcher with the robots in FLEET.yaml, and accept awards.

    For each notice, the robots decide by a protocol who makes which trip, in which order; the bid is the sum of delays.
    Each event (queued, underway, completed, canceled) is a line of JSON with the robot and its stops, for a program
    that drives the robots. Positions are estimated from the robots' speeds.

    \b
    robochoc rmf bid fleet.yaml --ros dds:0
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.ros.rmf import messages as m
    from robochoc.ros.rmf.bidder import Bidder
    from robochoc.ros.rmf.fleet_file import read_rmf_fleet
    from robochoc.ros.rmf.trips import trial_plan

    found = read_rmf_fleet(fleet)
    with errors_as_failures(f"--protocol {protocol}, tried on two trips"):
        trial_plan(found, protocol)
    bidder = Bidder(found, epoch_ns=_epoch_ns(), protocol=protocol)
    completed = 0

    def report() -> bool:
        nonlocal completed
        for event in bidder.drain_events():
            completed += event.what == "completed"
            _print_line(event=event.what, task=event.task_id, robot=event.robot, stops=event.stops)
        return tasks is not None and completed >= tasks

    sends = (m.BidResponse, m.DispatchAck, m.ApiResponse, m.TaskStateUpdate)
    with ros_errors_as_failures(), _opened(place, sends, (m.BidNotice, m.DispatchCommand, m.ApiRequest)) as exchange:
        click.echo(f"{place}: {found.name} bids with {len(found.robots)} robots", err=True)
        with errors_as_failures(f"--protocol {protocol}"):
            _run(exchange, bidder, report)


@rmf.command(short_help="Request a patrol, a delivery or a cleaning.")
@click.argument("category", type=click.Choice(["patrol", "delivery", "clean"]))
@click.argument("places", type=Name(), nargs=-1, required=True, metavar="PLACE ...")
@_ros
@click.option(
    "--rounds", type=WholeNumber(1, 1000), default=1, show_default=True, metavar="N", help="Rounds of a patrol."
)
@click.option("--fleet", type=Name(), metavar="NAME", help="The only fleet that may do the task.")
@click.option("--count", type=WholeNumber(1, 1000), default=1, show_default=True, metavar="N", help="Number of tasks.")
@click.option(
    "--timeout",
    type=Number(0, min_open=True),
    default=30.0,
    show_default=True,
    metavar="SECONDS",
    help="Longest wait for answers. Requests without an answer are repeated.",
)
def request(
    category: str, places: tuple[str, ...], place: str, rounds: int, fleet: str | None, count: int, timeout: float
) -> None:
    """Request tasks of a dispatcher: RMF's, or 'robochoc rmf dispatch'. Prints the id of each task.

    \b
    robochoc rmf request patrol pantry coe --rounds 2 --count 7
    robochoc rmf request delivery pantry coe
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.ros.rmf import messages as m

    task: dict[str, Any] = {"category": category, "description": _description(category, places, rounds)}
    task |= {"unix_millis_earliest_start_time": 0} | ({"fleet_name": fleet} if fleet else {})
    text = json.dumps({"type": "dispatch_task_request", "request": task})
    name = secrets.token_hex(4)
    waiting = {f"robochoc-{name}-{number}": m.ApiRequest(text, f"robochoc-{name}-{number}") for number in range(count)}
    until_s, repeat_s, is_refused = time.monotonic() + timeout, 0.0, False
    with ros_errors_as_failures(), _opened(place, (m.ApiRequest,), (m.ApiResponse,)) as exchange:
        while waiting and time.monotonic() < until_s:
            if time.monotonic() >= repeat_s:
                repeat_s = time.monotonic() + _REPEAT_S
                for one in waiting.values():
                    exchange.send(one)
            answer = exchange.next(_SLICE_S)
            if isinstance(answer, m.ApiResponse) and answer.request_id in waiting:
                del waiting[answer.request_id]
                is_refused |= not _print_answer(answer.json_msg)
    if waiting:
        raise Failure(LIMIT, f"{place}: no dispatcher has answered {len(waiting)} of {count} requests in {timeout:g} s")
    if is_refused:
        raise Failure(USAGE, f"{place}: the dispatcher has refused the task")


def _description(category: str, places: tuple[str, ...], rounds: int) -> dict[str, Any]:
    """Return the description of a task in RMF's form."""
    wanted = {"delivery": 2, "clean": 1}.get(category)
    if wanted is not None and len(places) != wanted:
        raise click.UsageError(f"'{category}' needs {wanted} place{'s' * (wanted > 1)}, not {len(places)}.")
    match category:
        case "patrol":
            return {"places": list(places), "rounds": rounds}
        case "delivery":
            stops = [{"place": place, "handler": "", "payload": []} for place in places]
            return {"pickup": stops[0], "dropoff": stops[1]}
        case _:
            return {"zone": places[0]}


def _print_answer(text: str) -> bool:
    """Print the id of a task, or the reason why it was refused; return whether it was accepted."""
    from robochoc.system.plain_text import on_one_line

    try:
        found = json.loads(text)
        if found["success"]:
            click.echo(on_one_line(str(found["state"]["booking"]["id"])))
            return True
    except (ValueError, LookupError, TypeError, RecursionError):
        pass
    click.echo(on_one_line(text[:500]), err=True)
    return False


def _opened(place: str, sends: Collection[type[Message]], receives: Collection[type[Message]]) -> Exchange:
    """Return a connection to the middleware at `place`. Raises `Failure`, `SinkError`, `SourceError`."""
    from robochoc.robots.connections import missing_packages_of
    from robochoc.ros.rmf.exchange import MIDDLEWARES, Exchange

    kind = place.partition(":")[0]
    if kind not in MIDDLEWARES:
        raise click.UsageError(f"--ros {place}: unknown middleware; use {', '.join(MIDDLEWARES)}, such as dds:5")
    missing = missing_packages_of(kind)
    if missing:
        raise Failure(USAGE, missing)
    return Exchange(place, sends, receives)


def _run(exchange: Exchange, core: _Core, report: Callable[[], bool]) -> None:
    """Connect a core with the middleware, until `report` returns True."""
    began_s = time.monotonic()
    while True:
        message = exchange.next(_SLICE_S)
        now_s = time.monotonic() - began_s
        if message is not None:
            core.receive(message, now_s)
        core.tick(now_s)
        for one in core.drain():
            exchange.send(one)
        if report():
            return


def _epoch_ns() -> int:
    return time.time_ns()


def _print_line(**fields: object) -> None:
    """Print a line of JSON at once. Unprintable characters are escaped."""
    click.echo(json.dumps(fields))
