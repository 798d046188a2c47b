"""`robochoc journal`: what it says, and exports that others can read."""

from __future__ import annotations

import base64
import csv
import io
import json
import os
import re
import shlex
import threading
import zlib
from pathlib import Path

import pytest
import sexpdata
from click.testing import CliRunner, Result

from robochoc.cli.group import cli
from robochoc.cli.reports.failures import INVALID, USAGE
from robochoc.formats import PREDEFINED
from robochoc.formats.team_writer import write_team
from robochoc.generators.coloring import coloring
from robochoc.journal.events import AnyEvent, Began, Decided, Received, Sent, Settled
from robochoc.journal.journal import Header, Journal, JournalRecorder, read_journal
from robochoc.model.problem import Constraint
from robochoc.run import Options, Runtime
from robochoc.sniffer.acl import parse
from robochoc.sniffer.columns import NOT_YET
from robochoc.sniffer.export import MOST_ARROWS, drawable, mermaid
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.patterns import matching, patterns_in
from robochoc.sniffer.trace import Trace
from tests.support.cases import cases
from tests.support.problems import team_of
from tests.support.program import robochoc_within
from tests.support.recorded_journals import record, recorded

NAME = "R;#1\nend"


def content_of(journal: Journal) -> bytes:
    recorder = JournalRecorder(journal.header)
    for event in journal.events:
        recorder(event)
    recorder.outcome = journal.outcome
    return recorder.content()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.journal"
    path.write_bytes(content_of(recorded("abt")))
    return path


def journal(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, ["journal", *map(str, arguments)])


def exported(file: Path, *arguments: str) -> str:
    result = journal("export", file, "--format", *arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def trace_of(file: Path) -> Trace:
    return Trace.of(read_journal(file.read_bytes()))


def test_show_says_what_is_in_it(file: Path) -> None:
    trace = trace_of(file)
    lines = journal("show", file).stdout.splitlines()
    assert lines[0] == "team       queens3d-3"
    assert lines[1] == "protocol   abt (simulator, seed 0)"
    assert f"messages   {len(trace.messages.t):,}, {sum(trace.messages.bytes):,} bytes" in lines
    assert any(line.strip().startswith("Ok ") for line in lines)
    assert lines[-2:] == ["replay     possible", "complete   yes"]


def test_show_tells_of_an_end_that_is_missing_and_keeps_names_on_their_lines(tmp_path: Path) -> None:
    recorder = JournalRecorder(Header(team="x\n\x1b[2Jy", protocol="abt", runtime="network", seed=1, order=("a", "b")))
    recorder(Settled(t=0, robot="a\nb", clock=0, checks=0))
    path = tmp_path / "broken.journal"
    path.write_bytes(recorder.content())
    shown = journal("show", path).stdout
    assert r"x\n\x1b[2Jy" in shown
    assert r"1: a\nb" in shown
    assert "order listed" in shown
    assert "The run ended without an outcome." in shown
    assert "not possible: the journal does not contain the robots' problems" in shown


def test_a_table_comes_back_as_the_trace(file: Path) -> None:
    trace, feed = trace_of(file), PageData(trace_of(file))
    of, steps = trace.messages, trace.steps
    rows = list(csv.DictReader(io.StringIO(exported(file, "csv"), newline="")))
    assert len(rows) == len(of.t)
    for message, row in enumerate(rows):
        taken = of.taken[message]
        seen = taken != NOT_YET
        assert row == {
            "message": str(message),
            "run": str(of.run[message] + 1),
            "step": str(of.step[message]),
            "sent_at": repr(of.t[message]),
            "taken_at": repr(steps.t[taken]) if seen else "",
            "taken_in_step": str(taken) if seen else "",
            "sender": trace.robots[of.sender[message]],
            "receiver": trace.robots[of.receiver[message]],
            "type": trace.kinds[of.kind[message]],
            "performative": {"Ok": "inform", "Nogood": "disconfirm", "AddLink": "subscribe"}[row["type"]],
            "bytes": str(of.bytes[message]),
            "clock": str(int(of.clock[message])),
            "taken_clock": str(int(steps.clock[taken])) if seen else "",
            "causes": " ".join(map(str, trace.causes(message))),
            "words": feed.words(message),
            "content": row["content"],
        }
        assert json.loads(row["content"]) == trace.content(message)


def test_costs_are_the_curve_that_a_study_records(tmp_path: Path) -> None:
    """DSA in cycles: the cost falls, and the time is the number of the cycle."""
    team, path = tmp_path / "team", tmp_path / "dsa.journal"
    write_team(coloring(12, 3, degree=4), team)
    words = ("--protocol", "dsa", "--set", "cycles=20", "--runtime", "simulator", "--schedule", "cycles")
    solved = robochoc_within("solve", team, *words, "--journal", path, "--json")
    assert solved.returncode == 0, solved.stderr
    rows = list(csv.DictReader(io.StringIO(exported(path, "costs"))))
    costs, cycles = [int(row["cost"]) for row in rows], [float(row["t"]) for row in rows]
    assert costs == sorted(set(costs), reverse=True)
    assert costs[-1] == json.loads(solved.stdout)["cost"]
    assert cycles == sorted(set(cycles))
    assert cycles[0] == 0
    assert cycles[-1] <= 20
    # In each cycle, each of the 12 robots sends its value to its neighbours: 48 messages.
    assert [int(row["messages"]) for row in rows] == [48 * (1 + int(cycle)) for cycle in cycles]
    done = journal("export", path, "--format", "costs", "-o", tmp_path / "costs.csv")
    assert f"{len(rows)} costs" in done.stdout
    refused = journal("export", path, "--format", "costs", "--from", "3")
    assert (refused.exit_code, "exports no messages" in refused.stderr) == (USAGE, True)


def test_a_run_without_costs_has_no_curve(file: Path) -> None:
    refused = journal("export", file, "--format", "costs")
    assert (refused.exit_code, "there are no costs" in refused.stderr) == (INVALID, True)


def test_acl_texts_are_messages_of_fipa(file: Path) -> None:
    trace = trace_of(file)
    lines = exported(file, "acl").splitlines()
    assert len(lines) == len(trace.messages.t)
    for message, line in enumerate(lines):
        acl = parse(line)
        read = sexpdata.loads(line)
        assert str(read[0]) == acl.performative.upper()
        keys = [str(key)[1:] for key in read[1::2]]
        values = dict(zip(keys, read[2::2], strict=True))
        kind, fields = json.loads(values["content"])
        assert acl.content == values["content"]
        assert (kind, fields) == (trace.kinds[trace.messages.kind[message]], trace.content(message))
        assert str(values["sender"][2]) == f"{trace.robots[trace.messages.sender[message]]}@localhost/robochoc"


def test_lines_are_the_journal_again(file: Path) -> None:
    before = read_journal(file.read_bytes())
    assert read_journal(exported(file, "jsonl").encode()) == before


def test_a_part_of_a_journal_is_a_journal_with_those_messages(file: Path) -> None:
    chosen = ("--robots", "Robot1.*,Robot2.1", "--types", "Ok,Nog*")
    part = read_journal(exported(file, "jsonl", *chosen).encode())
    whole = read_journal(file.read_bytes())
    meant = {"Robot1.1", "Robot1.2", "Robot1.3", "Robot2.1"}
    assert [event for event in part.events if isinstance(event, Sent)] == [
        event
        for event in whole.events
        if isinstance(event, Sent) and {event.sender, event.receiver} <= meant and event.type != "AddLink"
    ]
    assert [event for event in part.events if isinstance(event, Received)] == [
        event
        for event in whole.events
        if isinstance(event, Received) and {event.sender, event.receiver} <= meant and event.type != "AddLink"
    ]
    others = [event for event in part.events if not isinstance(event, Sent | Received)]
    assert others == [event for event in whole.events if not isinstance(event, Sent | Received)]
    assert Trace.of(part).unseen == 0


def test_numbers_and_conversations_are_chosen(file: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(exported(file, "csv", "--from", "5", "--to", "7", "--conversation", "1"))))
    assert [row["message"] for row in rows] == ["5", "6", "7"]


ARROW = re.compile(r"    R(\d+)(->>|-x)R(\d+): (\d+) (\w+)")
NOTE = re.compile(r"    Note over R(\d+): (.+)")
PARTICIPANT = re.compile(r"    participant R(\d+) as (.+)")


def test_a_diagram_has_the_messages_and_decisions_in_their_order(file: Path) -> None:
    trace, of = trace_of(file), trace_of(file).messages
    lines = exported(file, "mermaid", "--to", "60").splitlines()
    assert lines[0] == "sequenceDiagram"
    named = [match.groups() for line in lines if (match := PARTICIPANT.fullmatch(line))]
    assert all(trace.robots[int(number)] == name for number, name in named)
    arrows = [match.groups() for line in lines if (match := ARROW.fullmatch(line))]
    assert [(int(a), sign, int(b), int(number), kind) for a, sign, b, number, kind in arrows] == [
        (of.sender[one], "-x" if of.taken[one] == NOT_YET else "->>", of.receiver[one], one, trace.kinds[of.kind[one]])
        for one in range(61)
    ]
    notes = [match.groups() for line in lines if (match := NOTE.fullmatch(line))]
    last = of.step[60]
    assert notes == [
        (str(trace.steps.robot[step]), ", ".join(f"{name} = {value}" for name, value in taken.items()) or "no value")
        for step, taken in trace.decisions
        if step <= last and trace.steps.robot[step] in {int(number) for number, _ in named}
    ]
    assert len(lines) == 1 + len(named) + len(arrows) + len(notes)


def test_names_mean_nothing_to_mermaid() -> None:
    events: list[AnyEvent] = [
        Began(t=0, protocol="ABT"),
        Decided(t=0, robot=NAME, assignment={"a:b": 1}, clock=0),
        Sent(t=0, sender=NAME, receiver="%%{init}%%", type="Ok->>R1: x", content={}, bytes=1, clock=0),
        Settled(t=0, robot=NAME, clock=0, checks=0),
    ]
    journal = Journal(Header(team="", protocol="abt", runtime="", seed=0), tuple(events), None)
    diagram = mermaid(PageData(Trace.of(journal)), [0]).decode()
    assert diagram.splitlines() == [
        "sequenceDiagram",
        "    participant R0 as R#59;#35;1#65533;end",
        "    participant R1 as #37;#37;#123;init#125;#37;#37;",
        "    Note over R0: a#58;b = 1",
        "    R0-xR1: 0 Ok-#62;#62;R1#58; x",
    ]


def test_a_diagram_that_nobody_could_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "long.journal"
    path.write_bytes(content_of(recorded("mgm")))
    result = journal("export", path, "--format", "mermaid")
    assert result.exit_code == USAGE
    assert f"the maximum is {MOST_ARROWS} (select fewer with --robots" in result.output


def test_words_give_the_reason_of_each_nogood(tmp_path: Path) -> None:
    path, page = tmp_path / "a.journal", tmp_path / "words.txt"
    pairs = [Constraint(f"C{pair}", PREDEFINED["ne"], (*pair,), (*pair,)) for pair in ("AB", "AC", "BC")]
    team = team_of({"A": [1, 2], "B": [1, 2], "C": [1, 2]}, pairs)
    path.write_bytes(content_of(record(team, Options(protocol="abt", runtime=Runtime.SIMULATOR))))
    words = exported(path, "words")
    assert (
        """
RC receives 3
    C = 1 was ruled out by: A = 1
    C = 2 was ruled out by: B = 2
    no value was left, and it said Nogood to RB: while A = 1: B != 2
    it assumes that RB will change its value, and keeps C = 2, the first value that nothing rules out
  4 to RB: as long as A = 1, B cannot be 2
"""
        in words
    )
    assert words.startswith(
        "RA starts\n    it takes A = 1, the first value that nothing rules out\n  0 to RB: A = 1 from"
    )
    assert words.endswith("it concluded that there is no solution: no value is left, whatever the others take\n")
    nogoods = exported(path, "words", "--types", "Nogood")
    assert re.findall(r"^  (\d+) to (\w+)", nogoods, re.MULTILINE) == [
        ("4", "RB"),
        ("5", "RA"),
        ("9", "RB"),
        ("10", "RA"),
    ]
    assert nogoods.count("no value was left") == nogoods.count("receives") == 4
    assert (
        journal("export", path, "--format", "words", "-o", page).stdout
        == f"{page}: 12 messages, {len(words):,} bytes\n"
    )


def test_words_without_a_replay_are_the_messages(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    recorder = JournalRecorder(Header(team="x", protocol="nowhere", runtime="simulator", seed=1, order=("a", "b")))
    recorder(Sent(t=0, sender="a", receiver="b", type="Bid", content={"price": 3}, bytes=1, clock=0))
    recorder(Settled(t=0, robot="a", clock=0, checks=0))
    path.write_bytes(recorder.content())
    assert exported(path, "words") == "a starts\n  0 to b: a says Bid (inform): price = 3\n"


@pytest.mark.parametrize("chosen", [(), ("--types", "*", "--from", "7", "--conversation", "1")])
def test_with_the_refusal_comes_a_command_that_works(chosen: tuple[str, ...], tmp_path: Path) -> None:
    path, output = tmp_path / "a long one.journal", tmp_path / "of it.mmd"
    path.write_bytes(content_of(recorded("mgm")))
    result = journal("export", path, "--format", "mermaid", "-o", output, *chosen)
    assert result.exit_code == USAGE
    command = shlex.split(result.output.strip().rsplit("; for the first messages: ", 1)[1])
    assert command[0] == "robochoc"
    again = CliRunner().invoke(cli, command[1:])
    assert again.exit_code == 0, again.output
    arrows = [match for line in output.read_text().splitlines() if (match := ARROW.fullmatch(line))]
    assert len(arrows) == MOST_ARROWS
    assert arrows[0][4] == ("7" if chosen else "0")


def test_a_diagram_of_long_names_is_cut_until_it_can_be_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    feed = PageData(Trace.of(recorded("mgm")))
    monkeypatch.setattr("robochoc.sniffer.export.MOST_CHARACTERS", 3_000)
    part = drawable(feed, range(len(feed.trace.messages.t)))
    assert 20 < len(part) <= MOST_ARROWS / 4
    assert part[0] == 0
    assert mermaid(feed, part)


def test_a_page_holds_everything(file: Path, tmp_path: Path) -> None:
    output = tmp_path / "page.html"
    result = journal("export", file, "--format", "html", "-o", output)
    assert result.exit_code == 0, result.output
    page = output.read_text()
    trace = trace_of(file)
    assert f"{len(trace.messages.t):,} messages, {output.stat().st_size:,} bytes" in result.output
    assert 'id="feed:about"' in page
    assert 'id="feed:columns"' in page
    assert 'id="feed:details:0"' in page


def test_a_page_holds_the_whole_run_and_shows_some_robots_at_first(file: Path) -> None:
    page = exported(file, "html", "--robots", "Robot1.*")
    about = re.search(r'id="feed:about"[^>]*>([^<]*)<', page)
    assert about is not None
    told = json.loads(zlib.decompress(base64.b64decode(about[1])))
    assert (told["messages"], told["chosen"]) == (len(trace_of(file).messages.t), ["Robot1.*"])
    refused = journal("export", file, "--format", "html", "--types", "Nogood")
    assert refused.exit_code == USAGE
    assert "--format html exports all messages: remove --types" in refused.output


def test_a_page_that_no_browser_could_open_is_refused(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.cli.commands.journal.MOST_IN_PAGE", 10)
    result = journal("export", file, "--format", "html")
    assert result.exit_code == USAGE
    assert "too many for one page: at most 10 (use 'robochoc sniff'" in result.output


def test_a_choice_that_fits_nothing_is_told(file: Path) -> None:
    with cases() as each:
        for arguments, words in [
            (("--types", "Okay"), "no type of message matches 'Okay'; known names: AddLink, Nogood, Ok"),
            (("--robots", "Robot1.1,X*"), "no robot matches 'X*'; known names: Robot1.1, "),
            (("--conversation", "2"), "there is no conversation 2; conversations are 1 to 1"),
            (("--from", "-1"), "'-1' is not a whole number from 0 to 1,000,000,000,000"),
            (("--from", "5", "--to", "3"), "there is no message from 5 to 3; messages are 0 to "),
            (("--from", "999999"), "there is no message from 999999 on; messages are 0 to "),
        ]:
            with each(arguments):
                result = journal("export", file, "--format", "csv", *arguments)
                assert result.exit_code == USAGE
                assert words in result.output


def test_an_export_that_finds_no_room_says_which(file: Path) -> None:
    result = journal("export", file, "--format", "csv", "-o", "/dev/full")
    assert result.exit_code == INVALID
    assert result.output.startswith("/dev/full: the export cannot be written: No space left on device (")


def test_an_incomplete_journal_is_exported_with_a_warning(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-1])
    trace = trace_of(file)
    assert trace.damage
    result = journal("export", file, "--format", "csv")
    assert result.exit_code == 0
    assert result.stderr == f"{file}: only a part of the journal can be read: {trace.damage}\n"
    assert len(result.stdout.splitlines()) == 1 + len(trace.messages.t)
    assert journal("show", file).stdout.splitlines()[-1] == f"complete   no: {trace.damage}"


def test_a_journal_in_a_pipe_is_shown_and_exported(file: Path) -> None:
    """Each command reads the pipe once."""
    content = file.read_bytes()
    for arguments in (("show",), ("export", "--format", "jsonl"), ("export", "--format", "words")):
        reading, writing = os.pipe()
        writer = threading.Thread(target=_write_all, args=(writing, content))
        writer.start()
        piped = journal(arguments[0], f"/dev/fd/{reading}", *arguments[1:])
        os.close(reading)
        writer.join()
        assert piped.exit_code == 0
        assert piped.stdout == journal(arguments[0], file, *arguments[1:]).stdout


def test_a_named_pipe_is_opened_once(file: Path, tmp_path: Path) -> None:
    """The writer of a short journal has ended before the pipe could be opened again."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for arguments in (("show",), ("export", "--format", "csv")):
        writer = threading.Thread(target=pipe.write_bytes, args=(file.read_bytes(),))
        writer.start()
        piped = journal(arguments[0], pipe, *arguments[1:])
        writer.join()
        assert piped.stdout == journal(arguments[0], file, *arguments[1:]).stdout


def _write_all(descriptor: int, content: bytes) -> None:
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)


def test_what_is_no_journal_is_told(tmp_path: Path) -> None:
    path = tmp_path / "no.journal"
    for content in (b"", b"hello", b"\x00" * 100):
        path.write_bytes(content)
        for command in (("show", path), ("export", path, "--format", "csv")):
            result = journal(*command)
            assert result.exit_code == INVALID
            assert "give a file of 'robochoc solve --journal'" in result.output
    assert journal("show", tmp_path / "none").exit_code == INVALID


def test_patterns_are_like_those_of_jade() -> None:
    names = ["Robot1.1", "Robot1.2", "Robot12.1", "df", "a*b"]
    assert matching(names, patterns_in("Robot1.*, df")) == ["Robot1.1", "Robot1.2", "df"]
    assert matching(names, ("Robot1?.?",)) == ["Robot12.1"]
    assert matching(names, ("Robot?.?",)) == ["Robot1.1", "Robot1.2"]
    assert matching(names, ("*",)) == names
    assert matching(names, ("robot*", "")) == []
    assert matching(["a" * 60], (("a*" * 20) + "b",)) == []
