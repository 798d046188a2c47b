"""Files that robochoc reads: teams, scenarios, results, journals, recordings."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from random import Random

from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.flight.mission import mission_of
from robochoc.formats import InvalidInputError, read_team, write_team
from robochoc.formats.result import ResultError, read_result, result_json
from robochoc.journal.blocks import BEGINNING, PREAMBLE, BlockReader, JournalDamagedError, frame_block
from robochoc.journal.journal import Header, JournalError, JournalRecorder, lines_of, read_journal
from robochoc.model.outcome import EpochOutcome, Metrics, Outcome, PseudoTreeNode, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.inference.dpop import DPOP
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.robots.source import SourceError
from tests.fuzz.harness import Target, assert_clear
from tests.fuzz.mutations import (
    files_of,
    folder_of,
    in_folder,
    one_of,
    spoilt_bytes,
    spoilt_json,
    spoilt_msgpack,
    spoilt_text,
    spoilt_xml,
)
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_cost_team
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team
from tests.support.program import ROOT
from tests.support.ros_recordings import TOPICS, messages, read, write

STATUSES = {0, 1, 2, 3, 4}
LATEST_NS = (1 << 31) * 10**9
"""Later times are read of ROS 1, and not written."""


@contextmanager
def folder() -> Iterator[Path]:
    """A new folder, in memory where there is such a file system."""
    memory = Path("/dev/shm")  # noqa: S108 - the folder has a name of its own
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=memory if memory.is_dir() else None) as name:
        yield Path(name)


def ran(*words: object) -> None:
    """Run the command line: it ends with a status that is documented, and says nothing unclear."""
    done = CliRunner().invoke(cli, [*map(str, words)])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code in STATUSES, f"status {done.exit_code}"
    if done.output:
        assert_clear(done.output)


# Teams and scenarios


@cache
def teams() -> Sequence[bytes]:
    """Teams of all kinds."""
    chance = Random(0)
    makers = (random_team, random_cost_team, random_complex_team, random_pkc_team)
    made: list[bytes] = []
    for number in range(40):
        with suppress(ValueError):  # some have two definitions of one name
            made.append(folder_of(_files(makers[number % len(makers)](chance))))
    shown = [ROOT / "docs" / "examples" / name for name in ("rescue", "scouts", "patrol", "secrets", "arm", "hangar")]
    shown += [ROOT / "tests" / "data" / "complex"]
    return [*made, *(folder_of(_in(place)) for place in shown)]


def _files(team: Team) -> dict[str, bytes]:
    with folder() as place:
        write_team(team, place / "team")
        return _in(place / "team")


def _in(place: Path) -> dict[str, bytes]:
    return {str(path.relative_to(place)): path.read_bytes() for path in sorted(place.rglob("*.xml"))}


@contextmanager
def _laid_out(content: bytes) -> Iterator[Path | None]:
    """The files of an input in a folder; None where their names lead elsewhere, or a file system has none such."""
    with folder() as place:
        inside = place / "team"
        inside.mkdir()
        for name, text in files_of(content).items():
            path = inside / name
            if "\x00" in name or not path.resolve().is_relative_to(inside):
                yield None
                return
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(text)
            except (OSError, ValueError):
                yield None
                return
        yield inside


def check_team(content: bytes) -> bool:
    """A team is read, or every mistake is told; what is read can be written, and read again."""
    with _laid_out(content) as place:
        if place is None:
            return False
        try:
            team = read_team(place)
        except InvalidInputError as invalid:
            assert_clear(str(invalid))
            ran("validate", place)
            return False
        again = place.parent / "again"
        write_team(replace(team, scenario=()), again)
        assert read_team(again).robots == team.robots, "another team is read from what was written"
        return True


# Scenarios: the same files, of teams that change, with all the mutations in scenario.xml


@cache
def scenarios() -> Sequence[bytes]:
    """Teams with a scenario."""
    shown = _in(ROOT / "docs" / "examples" / "rescue")
    return [folder_of(shown), *(folder_of({**shown, "scenario.xml": text}) for text in _SCENARIOS)]


_SCENARIOS = (
    b"""<scenario><event after="solved"><remove_value variable="North.slot" value="1"/></event></scenario>""",
    b"""<scenario><event after="100 cycles"><remove_agent name="Medic"/></event>
<event after="solved"><add_agent file="late/Spare.xml"/></event></scenario>""",
)
_scenario_mutation = one_of(spoilt_xml, spoilt_xml, spoilt_text, spoilt_bytes)


def spoilt_scenario(chance: Random, content: bytes) -> bytes:
    """Spoil `scenario.xml`, seldom another file."""
    files = files_of(content)
    if "scenario.xml" not in files or chance.random() < 0.1:
        return in_folder(_scenario_mutation)(chance, content)
    files["scenario.xml"] = _scenario_mutation(chance, files["scenario.xml"])
    return folder_of(files)


# Results


def results() -> Sequence[bytes]:
    """Results with and without all that can be in one."""
    counts = Metrics({"Ok": 3, "Nogood": 1}, 90, 7, 20, 0.5, 0.25, 4096, 1.5)
    epoch = EpochOutcome(Verdict.SOLUTION, robots=("A", "B"), assignment={"V": 1}, cost=2, metrics=counts, lost=("B",))
    whole = Outcome(
        Verdict.OPTIMAL,
        team="four",
        protocol="abt",
        runtime="simulator",
        seed=7,
        assignment={"V1.1": 1, "V1.2": -3},
        cost=12,
        withdrawn=("Robot3",),
        metrics=counts,
        reason="why",
        count=3,
        lost=("Robot3",),
        order="listed",
        bound=11,
        tree={"A": PseudoTreeNode(None), "B": PseudoTreeNode("A", ("C",))},
        epochs=(epoch, epoch),
        channel="radio",
        placed_by="sfb",
    )
    return [
        result_json(whole),
        result_json(Outcome(Verdict.NO_SOLUTION, team="t", protocol="abt", runtime="processes", seed=0)),
    ]


def check_result(content: bytes) -> bool:
    """A result is read or refused; what is read is written, and read as the same; there is a flight to it."""
    with folder() as place:
        file = place / "result.json"
        file.write_bytes(content)
        try:
            outcome = read_result(content)
        except ResultError:
            ran("animate", file, "-o", place / "page.html")
            return False
        mission_of(outcome)
    written = result_json(outcome)
    assert result_json(read_result(written)) == written, "another result is read from what was written"
    return True


# Journals


@cache
def journals() -> Sequence[bytes]:
    """Journals of searches, in blocks."""
    chance = Random(1)
    return [
        _journal(random_team(chance, n_ary=False), ABT),
        _journal(random_cost_team(chance), DPOP),
    ]


def _journal(team: Team, protocol: type[ABT | DPOP]) -> bytes:
    blocks: list[bytes] = []
    name = protocol.__name__.lower()
    recorder = JournalRecorder(
        Header(team=team.name, protocol=name, runtime="simulator", seed=0), sinks=[blocks.append]
    )
    result = Simulation(team, protocol, Concurrent(seed=0), observer=recorder).run()
    recorder.flush()
    recorder.outcome = Outcome(
        result.verdict or Verdict.SOLUTION, team=team.name, protocol=name, runtime="simulator", seed=0
    )
    recorder.close()
    return b"".join(blocks)


@cache
def journal_texts() -> Sequence[bytes]:
    """The same as text."""
    return [b"".join(lines_of(read_journal(content))) for content in journals()]


def spoilt_journal(chance: Random, content: bytes) -> bytes:
    """Spoil what a block holds and give it a right checksum again, or spoil the file."""
    if chance.random() < 0.2:
        return spoilt_bytes(chance, content)
    unframer = BlockReader()
    unframer.feed(content)
    try:
        contents = list(iter(unframer.next, None))
    except (JournalDamagedError, JournalError):
        return spoilt_bytes(chance, content)
    if not contents:
        return content
    at = chance.randrange(len(contents))
    contents[at] = one_of(spoilt_msgpack, spoilt_msgpack, spoilt_bytes)(chance, contents[at])
    journal, digest = PREAMBLE, BEGINNING
    for each in contents:
        block, digest = frame_block(each, digest)
        journal += block
    return journal


def check_journal(content: bytes) -> bool:
    """A journal is read, or refused; what is read is written as text, and read as the same; reports are clear."""
    with folder() as place:
        file = place / "run.journal"
        file.write_bytes(content)
        try:
            journal = read_journal(content)
        except JournalError:
            ran("journal", "show", file)
            return False
        for words in (("journal", "show", file), ("replay", file)):
            ran(*words)
        for form in ("csv", "acl", "mermaid"):
            ran("journal", "export", file, "--format", form, "-o", place / form)
    once = [*lines_of(journal)]
    twice = [*lines_of(read_journal(b"".join(once)))]
    assert len(twice) == len(once), "fewer entries are read than were written"
    # What is no number becomes null, and a time that is whole a float: once.
    assert [*lines_of(read_journal(b"".join(twice)))] == twice, "another journal is read from what was written"
    return True


# Recordings

TOPIC = "/a_1/waypoint"


@cache
def recordings(kind: str) -> Sequence[bytes]:
    """Recordings as sinks write them."""
    with folder() as place:
        return [write(f"{kind}:{place / f'{number}'}", messages(number)).read_bytes() for number in (1, 4, 40)]


def check_recording(kind: str, content: bytes) -> bool:
    """A recording is read or refused; what is read is written, and read as the same."""
    with folder() as place:
        file = place / "run"
        file.write_bytes(content)
        try:
            heard = read(f"{kind}:{file}")
        except SourceError as failed:
            assert_clear(str(failed))
            return False
        times = [one.at_ns for one in heard]
        stamps = [header["stamp"] for one in heard if isinstance(header := one.fields.get("header"), Mapping)]
        if len({*times}) < len(times) or any(one >= LATEST_NS for one in (*times, *stamps)):
            return True  # of two at the same time, either may be first
        again = write(f"{kind}:{place / 'again'}", [(one.topic, one.fields, one.at_ns) for one in heard], TOPICS)
        found = read(f"{kind}:{again}")
        order = sorted(heard, key=lambda one: one.at_ns)
        assert repr(found) == repr(order), "other messages are read from what was written"
        return True


TARGETS = (
    Target("team", teams, in_folder(one_of(spoilt_xml, spoilt_xml, spoilt_xml, spoilt_text, spoilt_bytes)), check_team),
    Target("scenario", scenarios, spoilt_scenario, check_team),
    Target("result", results, one_of(spoilt_json, spoilt_json, spoilt_text, spoilt_bytes), check_result),
    Target("journal", journals, spoilt_journal, check_journal),
    Target("journal-text", journal_texts, one_of(spoilt_text, spoilt_bytes), check_journal),
    *(
        Target(kind, partial(recordings, kind), one_of(spoilt_bytes, spoilt_text), partial(check_recording, kind))
        for kind in ("mcap", "rosbag")
    ),
)
