"""The file of a leaderboard's results: reads and writes it. docs/reference/leaderboard.md describes the format.

The same protocols, instances and budget give the same bytes, unless times are recorded or a run meets its time limit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from robochoc.experiments.task import Status
from robochoc.formats.diagnostics import InvalidInputError, invalid_input, shortened
from robochoc.leaderboard.certificates import published
from robochoc.leaderboard.instances import SET_VERSION
from robochoc.model.outcome import Verdict
from robochoc.system.files import write_atomically

LARGEST_FILE = 256 * 2**20
"""The maximum size of a file with results, in bytes."""
FORMAT = 1
PEER_NAMES = ("frodo", "pydcop", "propflow")
"""The names of peers, which are other tools."""
PEER_SEPARATOR = ":"
"""It separates the name of a peer from its algorithm; names of protocols do not contain it."""
LARGEST_COUNT = 2**53
Count = Annotated[int, msgspec.Meta(ge=0, le=LARGEST_COUNT)]
Limit = Annotated[int, msgspec.Meta(gt=0, le=LARGEST_COUNT)]
Cost = Annotated[int, msgspec.Meta(ge=-LARGEST_COUNT, le=LARGEST_COUNT)]
Name = Annotated[str, msgspec.Meta(max_length=200, pattern=r"^[A-Za-z0-9][A-Za-z0-9 .,_+:-]*\Z")]
Place = Annotated[str, msgspec.Meta(max_length=400, pattern=r"^([\w.]+:[\w.]+)?\Z")]
Text = Annotated[str, msgspec.Meta(max_length=1000)]


class Budget(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """The limits of each run.

    Attributes:
        messages: The maximum number of messages.
        ncccs: The maximum number of non-concurrent constraint checks.
        cycles: The maximum number of cycles; robots then act in cycles.
        time_s: The maximum seconds.
    """

    messages: Limit = 20_000
    ncccs: Limit | None = None
    cycles: Limit | None = None
    time_s: Annotated[float, msgspec.Meta(gt=0, le=1e6)] = 60.0


class Entrant(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A protocol in the results.

    Attributes:
        name: The name of the protocol.
        package: The package that offers it, with its version.
        place: The module and the class of another package's protocol (MODULE:CLASS); empty for one of robochoc.
        source: The digest of the files of another package's protocol; empty for a protocol of robochoc.
    """

    name: Name
    package: Text = ""
    place: Place = ""
    source: Text = ""


class RunResult(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """One run of a protocol on an instance.

    Attributes:
        instance: The name of the instance.
        protocol: The name of the protocol.
        status: The status, as in a study.
        reason: The reason for a missing verdict.
        verdict: The verdict.
        cost: The cost of the answer.
        assignment: The values of all variables in the answer.
        messages: The number of messages.
        bytes: The bytes of their contents.
        ncccs: The non-concurrent constraint checks.
        curve: The number of messages sent until each improvement, and the cost after it.
        privacy: The mean loss by EntropyTS, over the kinds of secrets. None: not measured, or not known.
        cpu_s: The seconds of processor time, if times are recorded.
        claimed_verdict: The verdict that a peer states. It is not the verdict if the checks contradict it.
        claimed_cost: The cost that a peer states; `cost` is computed here.
    """

    instance: Name
    protocol: Name
    status: Status
    reason: Text | None = None
    verdict: Verdict | None = None
    cost: Cost | None = None
    assignment: dict[str, Cost] = {}
    messages: Count | None = None
    bytes: Count | None = None
    ncccs: Count | None = None
    curve: list[tuple[Count, Cost]] = []
    privacy: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None
    cpu_s: Annotated[float, msgspec.Meta(ge=0)] | None = None
    claimed_verdict: Name | None = None
    claimed_cost: float | None = None

    @property
    def is_by_peer(self) -> bool:
        """True if another tool solved the problem."""
        return is_peer_name(self.protocol)


class LeaderboardResults(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The content of a file with results.

    Attributes:
        format: The version of the format.
        benchmark_set: The version of the benchmark set.
        robochoc: The version of robochoc.
        seed: The seed of all runs.
        budget: The limits of each run.
        entrants: The protocols.
        runs: The runs, in the order of the instances and protocols.
    """

    format: int
    benchmark_set: int
    robochoc: Text
    seed: Count
    budget: Budget
    entrants: list[Entrant]
    runs: list[RunResult]


def is_peer_name(name: str) -> bool:
    """Return whether a name is that of a peer's algorithm, as in `pydcop:dpop`."""
    peer, separator, _ = name.partition(PEER_SEPARATOR)
    return bool(separator) and peer in PEER_NAMES


def write_results(results: LeaderboardResults, path: Path) -> None:
    """Write the results, with one line for each run. Raises `OSError`."""
    head = msgspec.structs.asdict(results)
    runs = head.pop("runs")
    opening = msgspec.json.encode(head).decode().removesuffix("}")
    lines = ",\n".join(msgspec.json.encode(run).decode() for run in runs)
    write_atomically(path, f'{opening},"runs":[\n{lines}\n]}}\n'.encode())


def read_results(path: Path) -> LeaderboardResults:
    """Return the results in a file.

    Raises:
        InvalidInputError: if the file is invalid, or has results of another version of the set.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise _invalid(path, f"cannot be read: {error.strerror}") from None
    if len(content) > LARGEST_FILE:
        raise _invalid(path, f"is larger than {LARGEST_FILE:,} bytes")
    try:
        found = msgspec.json.decode(content, type=LeaderboardResults)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as wrong:
        raise _invalid(path, f"has no valid results: {shortened(str(wrong))}") from None
    _check(found, path)
    return found


def _check(found: LeaderboardResults, path: Path) -> None:
    """Raise `InvalidInputError` for another version, an unknown instance or protocol, or a repeated or missing run."""
    if (found.format, found.benchmark_set) != (FORMAT, SET_VERSION):
        text = f"has format {found.format} and set {found.benchmark_set}, not format {FORMAT} and set {SET_VERSION}"
        raise _invalid(path, text)
    names = {one.name for one in found.entrants}
    if len(names) < len(found.entrants):
        raise _invalid(path, "names an entrant twice")
    seen = set()
    for run in found.runs:
        if run.instance not in published():
            raise _invalid(path, f"names {run.instance!r}, which is not an instance of the set")
        if run.protocol not in names:
            raise _invalid(path, f"has a run of {run.protocol!r}, which is not among its entrants")
        if (run.instance, run.protocol) in seen:
            raise _invalid(path, f"has two runs of {run.protocol} on {run.instance}")
        seen.add((run.instance, run.protocol))
    for name in sorted({run.instance for run in found.runs}):  # runs that are left out would improve the ranks
        for one in found.entrants:
            if (name, one.name) not in seen:
                raise _invalid(path, f"has no run of {one.name} on {name}, unlike its other entrants")


def _invalid(path: Path, message: str) -> InvalidInputError:
    return invalid_input(path, message, "give a file that 'robochoc leaderboard run' writes")
