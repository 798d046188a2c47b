"""Executes one run on a cluster's worker, and collects the data that the worker needs."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path

import msgspec

from robochoc.experiments.execute import TaskRunner
from robochoc.experiments.task import Task
from robochoc.system.temporary_files import PrivateFolder

_KEPT = threading.local()


def files_of(task: Task) -> dict[str, bytes]:
    """Return the contents of the files of a task's problem, by name; empty if the problem is generated."""
    path = Path(task.problem.path)
    if not task.problem.path:
        return {}
    if path.is_file():
        return {path.name: path.read_bytes()}
    return {str(one.relative_to(path)): one.read_bytes() for one in sorted(path.rglob("*")) if one.is_file()}


def run_one(content: bytes, files: Mapping[str, bytes]) -> bytes:
    """Run one task on a cluster's worker, and return its row.

    Args:
        content: The task as JSON.
        files: The contents of the problem's files.
    """
    task = msgspec.json.decode(content, type=Task)
    if not files:
        return msgspec.json.encode(_bench().run(task))
    with PrivateFolder() as folder:
        name = Path(task.problem.path).name
        single = len(files) == 1 and name in files
        place = Path(folder) if single else Path(folder) / name
        for file, held in files.items():
            target = place / file
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(held)
        here = msgspec.structs.replace(task.problem, path=str(place / name if single else place))
        return msgspec.json.encode(_bench().run(msgspec.structs.replace(task, problem=here)))


def _bench() -> TaskRunner:
    """Return the task runner of the calling thread; its constraint solver can only serve one run at a time."""
    if not hasattr(_KEPT, "bench"):
        _KEPT.bench = TaskRunner()
    bench: TaskRunner = _KEPT.bench
    return bench
