"""Opens a file as a new team, in a separate process, since reading an untrusted file can take any time and memory.

python -m robochoc.app.open_file STORE FILE
"""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

import msgspec

from robochoc.app.flights.saved_state import unpack_run
from robochoc.app.jobs.job import Job, LateError
from robochoc.app.jobs.process import Command
from robochoc.app.sketch.open_from_disk import open_team
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from robochoc.app.texts import say
from robochoc.formats import InvalidInputError

PATIENCE_S = 60.0
"""The time limit for opening a file, in seconds."""


class OpenedFile(msgspec.Struct, frozen=True):
    """The id of the new team, or the errors in the file, one per line."""

    team: str = ""
    mistakes: str = ""


def open_file_job(file: Path, store: TeamStore, *, within_s: float = PATIENCE_S) -> Job[OpenedFile]:
    """Start opening `file` as a new team in `store`, and return the job."""

    def work(job: Job[OpenedFile]) -> OpenedFile:
        try:
            finished = job.run(Command((str(store.folder), str(file)), module=__name__), within_s=within_s)
        except LateError:
            return OpenedFile(mistakes=say("gallery.too-slow", name=file.name, seconds=f"{within_s:g}"))
        if finished.status or not finished.out:
            return OpenedFile(mistakes=say("gallery.broken", name=file.name, why=finished.why.splitlines()[-1]))
        return msgspec.json.decode(finished.out, type=OpenedFile)

    return Job(f"opening of {file.name}", work).start()


def main() -> None:
    """Open the file."""
    store, file = TeamStore(Path(sys.argv[1])), Path(sys.argv[2])
    try:
        found = open_team(file)
        team = store.add(found) if isinstance(found, Sketch) else store.add_imported(found)
        with suppress(OSError):  # a saved state also contains a run
            unpack_run(file, store.path(team))
    except (InvalidInputError, OSError) as error:
        answer = OpenedFile(mistakes=str(error))
    else:
        answer = OpenedFile(team)
    sys.stdout.buffer.write(msgspec.json.encode(answer))


if __name__ == "__main__":
    main()
