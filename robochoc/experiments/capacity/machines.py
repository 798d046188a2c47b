"""Measures the machines of a Dask cluster, each by itself and all at the same time. Extra: `cluster`.

One worker of each machine runs `robochoc capacity` as a program of its own, since robots have processes.
"""

from __future__ import annotations

import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
from distributed import CancelledError, Client, Future
from distributed.scheduler import KilledWorker

from robochoc.communication.cluster_client import SchedulerLostError, connect
from robochoc.communication.cluster_tasks import discarded_check, result_of
from robochoc.experiments.capacity.search import Capacity
from robochoc.experiments.remote_task import files_of, write_files
from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.system.temporary_files import PrivateFolder

START_S = 60.0
"""The time that a machine may need beyond its time for measuring, to start and to answer."""
_POLL_S = 0.2


class Machine(msgspec.Struct, frozen=True):
    """The result of a machine.

    Attributes:
        host: The address or name of the machine.
        capacity: The result; None: the machine could not be measured.
        error: The reason; empty: there is a result.
    """

    host: str
    capacity: Capacity | None = None
    error: str = ""


def measure_machines(cluster: str, paths: Sequence[Path], options: Sequence[str], timeout_s: float) -> list[Machine]:
    """Return the capacity of each machine of a cluster, sorted by host.

    Args:
        cluster: The address of the scheduler, or the path of its JSON file.
        paths: The paths of `robochoc capacity`; their files are sent to the machines.
        options: The options of `robochoc capacity`.
        timeout_s: The longest time for all measurements, in seconds.

    Raises:
        SchedulerLostError: if the scheduler cannot be reached, is lost, or has no workers.
    """
    files = [(path.name, files_of(path)) for path in paths]
    words = [*options, "--timeout", str(timeout_s)]
    with connect(cluster, "robochoc capacity") as client:
        workers = worker_of_each_host(_workers(client))
        if not workers:
            raise SchedulerLostError(f"the cluster at {cluster} has no workers: start workers by 'dask worker'")
        futures = {
            host: client.submit(
                _run_on_worker, files, words, timeout_s + START_S,
                key=f"robochoc-capacity-{uuid.uuid4().hex}", workers=[address], pure=False,
            )
            for host, address in workers.items()
        }  # fmt: skip
        try:
            _wait(client, futures, workers, time.monotonic() + timeout_s + 2 * START_S)
            return [_machine(host, futures[host]) for host in sorted(futures)]
        finally:
            with suppress(CancelledError, OSError):  # the scheduler is lost
                client.cancel([*futures.values()])


def run_capacity(
    files: Sequence[tuple[str, Mapping[str, bytes]]],
    options: Sequence[str],
    limit_s: float,
    is_discarded: Callable[[], bool] = lambda: False,
) -> tuple[bytes, str]:
    """Run `robochoc capacity`, and return its standard output and the reason if it has none.

    Args:
        files: The names of teams or task lists, with the content of their files.
        options: The options of `robochoc capacity`.
        limit_s: The longest time, in seconds.
        is_discarded: Called from time to time. If it returns True, the program is ended.
    """
    until_s = time.monotonic() + limit_s
    with PrivateFolder() as folder:
        paths = [str(write_files(some, Path(folder) / str(number), name)) for number, (name, some) in enumerate(files)]
        command = [sys.executable, "-m", "robochoc", "capacity", *paths, *options, "--json"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:  # noqa: S603 - this program
            while True:
                left_s = until_s - time.monotonic()
                if left_s <= 0 or is_discarded():
                    program.terminate()
                    with suppress(subprocess.TimeoutExpired):
                        program.wait(START_S)
                    program.kill()
                    return b"", f"no result within {limit_s:g} s"
                with suppress(subprocess.TimeoutExpired):
                    output, errors = program.communicate(timeout=min(left_s, _POLL_S))
                    return output, errors.decode(errors="replace")


def _run_on_worker(
    files: Sequence[tuple[str, Mapping[str, bytes]]], options: Sequence[str], limit_s: float
) -> tuple[bytes, str]:
    """Run `robochoc capacity` as a task of a worker, until the client is gone."""
    return run_capacity(files, options, limit_s, discarded_check())


def worker_of_each_host(workers: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return the address of one worker by host."""
    return {str(workers[address]["host"]): address for address in sorted(workers, reverse=True)}


def _workers(client: Client) -> Mapping[str, Mapping[str, Any]]:
    known: Mapping[str, Any] = {}
    with suppress(CancelledError, OSError):
        known = client.scheduler_info(n_workers=-1)
    if "workers" not in known:
        raise SchedulerLostError("the scheduler of the cluster was lost: repeat the command")
    workers: Mapping[str, Mapping[str, Any]] = known["workers"]
    return workers


def _wait(client: Client, futures: Mapping[str, Future], workers: Mapping[str, str], until_s: float) -> None:
    """Wait until each machine has answered, or its worker is lost."""
    while time.monotonic() < until_s:
        known = _workers(client)
        if all(futures[host].done() or address not in known for host, address in workers.items()):
            return
        time.sleep(_POLL_S)


def _machine(host: str, future: Future) -> Machine:
    if not future.done():
        return Machine(host, error="the worker was lost, or does not answer")
    try:
        content, why = result_of(future)
    except SchedulerLostError:
        raise
    except (KilledWorker, OSError) as error:
        return Machine(host, error=f"the worker was lost: {type(error).__name__}")
    except Exception as error:  # noqa: BLE001 - any error of a machine is its result
        return Machine(host, error=shortened(on_one_line(f"{type(error).__name__}: {error}")))
    try:
        return Machine(host, msgspec.json.decode(content, type=Capacity))
    except msgspec.DecodeError:
        lines = why.strip().splitlines() or ["the program has printed no result"]
        return Machine(host, error=on_one_line(lines[-1])[:300])
