"""One run on another machine: what travels there, and what is done with it."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path

import msgspec

from robochoc.experiments.execute import Bench
from robochoc.experiments.task import Task
from robochoc.system.temporary_files import PrivateFolder

_KEPT = threading.local()


def files_of(task: Task) -> dict[str, bytes]:
    """Return the files of a task's problem by their names, if it is in files: they travel with it."""
    path = Path(task.problem.path)
    if not task.problem.path:
        return {}
    if path.is_file():
        return {path.name: path.read_bytes()}
    return {str(one.relative_to(path)): one.read_bytes() for one in sorted(path.rglob("*")) if one.is_file()}


def run_one(content: bytes, files: Mapping[str, bytes]) -> bytes:
    """Run one task on a worker of the cluster, and return its row.

    Args:
        content: The task as JSON.
        files: The files of its problem, which are not here.
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


def _bench() -> Bench:
    """Return the bench of this thread: a constraint solver serves one run at a time."""
    if not hasattr(_KEPT, "bench"):
        _KEPT.bench = Bench()
    bench: Bench = _KEPT.bench
    return bench
