"""The main loop of the process of an external solver: receives tasks from the parent, and sends an answer to each."""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
from collections.abc import Callable
from io import BufferedRWPair

import msgspec

from robochoc.solver.errors import SolverMissingError
from robochoc.solver.network_task import LENGTH, FromSolver, NetworkTask, TaskAnswer, TaskFailed
from robochoc.solver.process_socket import connect_to_parent
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import leave_ctrl_c_to_the_parent, signal_when_orphaned


def serve(solve: Callable[[NetworkTask], TaskAnswer], *, ends_group: bool = True) -> None:
    """Answer the parent's tasks with `solve` until it closes the connection, whose address is the first argument.

    With `ends_group`, the programs that `solve` has started end with this process.
    """
    if IS_POSIX:
        signal_when_orphaned(signal.SIGKILL)
    leave_ctrl_c_to_the_parent()
    stream = connect_to_parent(sys.argv[1]).makefile("rwb")
    tasks: queue.SimpleQueue[NetworkTask] = queue.SimpleQueue()
    threading.Thread(target=_receive_tasks, args=(stream, tasks, ends_group), daemon=True).start()
    while True:
        _send(stream, _answer(solve, tasks.get()))


def _receive_tasks(stream: BufferedRWPair, tasks: queue.SimpleQueue[NetworkTask], ends_group: bool) -> None:  # noqa: FBT001
    """Receive tasks. End the process, and perhaps its group, when the parent closes the connection."""
    decoder = msgspec.msgpack.Decoder(NetworkTask)
    while len(head := stream.read(LENGTH.size)) == LENGTH.size:
        tasks.put(decoder.decode(stream.read(LENGTH.unpack(head)[0])))
    if ends_group and IS_POSIX and os.getpgid(0) == os.getpid():
        os.killpg(0, signal.SIGKILL)
    os._exit(0)


def _send(stream: BufferedRWPair, message: FromSolver) -> None:
    body = msgspec.msgpack.encode(message)
    stream.write(LENGTH.pack(len(body)) + body)
    stream.flush()


def _answer(solve: Callable[[NetworkTask], TaskAnswer], task: NetworkTask) -> FromSolver:
    if any(table.allowed and not table.rows for table in task.tables):
        return TaskAnswer(None, proven=True)
    try:
        return solve(task)
    except (ImportError, SolverMissingError) as error:
        return TaskFailed(str(error), missing=True)
    except Exception as error:  # noqa: BLE001 - any error is reported to the parent
        return TaskFailed(f"{type(error).__name__}: {error}")
