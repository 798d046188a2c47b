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


def files_of(path: Path) -> dict[str, bytes]:
    """Return the contents of the file or folder of a problem, by name."""
    if path.is_file():
        return {path.name: path.read_bytes()}
    return {str(one.relative_to(path)): one.read_bytes() for one in sorted(path.rglob("*")) if one.is_file()}


def write_files(files: Mapping[str, bytes], folder: Path, name: str) -> Path:
    """Write the files of a problem with this name into a folder on a worker, and return its path."""
    path = folder / name
    for file, content in files.items():
        target = path if [*files] == [name] else path / file
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    return path


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
        path = write_files(files, Path(folder), Path(task.problem.path).name)
        here = msgspec.structs.replace(task.problem, path=str(path))
        return msgspec.json.encode(_bench().run(msgspec.structs.replace(task, problem=here)))


def _bench() -> TaskRunner:
    """Return the task runner of the calling thread; its constraint solver can only serve one run at a time."""
    if not hasattr(_KEPT, "bench"):
        _KEPT.bench = TaskRunner()
    bench: TaskRunner = _KEPT.bench
    return bench
