"""`robochoc sniff` and `solve --sniff`: what they say, and whatever dies leaves nothing behind."""

from __future__ import annotations

import json
import re
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Self
from urllib.request import urlopen

import pytest

from robochoc.cli.commands.solve import solve
from robochoc.cli.options.solve import SolveCommand
from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.sniffer.viewer import Viewer
from tests.support.faults import PROGRAM, Run, running
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT, robochoc_within
from tests.support.sniffer_server import journal_of, run_events

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
LONG = ("--timeout", "3600")


@pytest.fixture(scope="module")
def teams(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("teams")
    write_team(queens3d(3), folder / "short")
    write_team(queens3d(8), folder / "long")
    return folder


def url_of(run: Run) -> str:
    """Where the page is, once that is told."""
    wait_until(lambda: "http://" in run.errors() or run.is_over, "no URL was told")
    found = re.search(r"http://127\.0\.0\.1:\d+/\S+/", run.errors())
    assert found, run.errors()
    return found[0]


def about(url: str) -> dict[str, object]:
    with urlopen(f"{url}about", timeout=HANG_S) as answer:  # noqa: S310 - our own server
        found: dict[str, object] = json.load(answer)
    return found


def viewer_of(run: Run) -> int:
    """The viewer's process, once it can be told from the run that starts it."""
    wait_until(lambda: run.program("viewer") is not None, "there is no viewer")
    viewer = run.program("viewer")
    assert viewer is not None
    return viewer


def all_is_gone(run: Run) -> None:
    run.end()
    assert run.left_behind() == []


# The browser

BROWSER = """\
#!{python}
import json, os, re, stat, sys
from pathlib import Path
from urllib.request import urlopen
shown = sys.argv[1]
file = Path(shown.removeprefix("file://"))
modes = [stat.S_IMODE(path.stat().st_mode) for path in (file, file.parent)]
url = re.search(r'url=(http://[^"]+)"', file.read_text())[1]
urlopen(url + "about", timeout={hang_s}).close()
Path({told!r} + ".part").write_text(json.dumps([sys.argv, dict(os.environ), modes, url]))
Path({told!r} + ".part").rename({told!r})
"""


@pytest.mark.parametrize("command", ["sniff", pytest.param("solve", marks=pytest.mark.more)])
def test_no_process_shows_the_secret_address_to_others(
    command: str, teams: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program, browser = tmp_path / "browser", tmp_path / "what the browser was told"
    program.write_text(BROWSER.format(python=sys.executable, told=str(browser), hang_s=HANG_S))
    program.chmod(0o700)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("BROWSER", str(program))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    (tmp_path / "journal").write_bytes(journal_of(*run_events()))
    words = ["sniff", str(tmp_path / "journal")] if command == "sniff" else ["solve", str(teams / "short"), "--sniff"]
    with running([PROGRAM, *words, "--open"], tmp_path / "run") as run:
        url = url_of(run)
        wait_until(browser.exists, "no browser has come")
        argv, environ, modes, followed = json.loads(browser.read_text())
        assert followed == url
        assert modes == [0o600, 0o700]
        secret = url.split("/")[3]
        assert secret not in json.dumps([argv, environ])
        for pid in run.processes():
            for what in ("cmdline", "environ"):
                with suppress(OSError):  # the browser has gone meanwhile
                    assert secret.encode() not in Path(f"/proc/{pid}/{what}").read_bytes()
        run.strike(signal.SIGINT)
        all_is_gone(run)
    assert [*(tmp_path / "tmp").iterdir()] == []


# robochoc sniff


def test_what_is_no_journal_is_told_in_one_line(tmp_path: Path) -> None:
    for content, said in [
        (b"what is this?", "the file does not start like a journal"),
        (b"<html>" * 1000, "the file does not start like a journal"),
        (b'{"event":"Journal"}\n', "is missing"),
    ]:
        file = tmp_path / "file"
        file.write_bytes(content)
        done = robochoc_within("sniff", file)
        assert done.returncode == 1
        assert re.fullmatch(
            rf".*/file: .*{re.escape(said)}.* \(give a file of 'robochoc solve --journal'\)\n", done.stderr
        )


def test_a_file_that_is_not_there_or_none_is_told(tmp_path: Path) -> None:
    for path, said in (
        (tmp_path / "nowhere", "No such file"),
        (tmp_path, "not a regular file"),
        (Path("/dev/null"), "not a regular file"),
    ):
        done = robochoc_within("sniff", path)
        assert done.returncode == 1
        assert said in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("signum", "status"),
    [(signal.SIGINT, 0), pytest.param(signal.SIGTERM, 128 + signal.SIGTERM, marks=pytest.mark.more)],
)
def test_a_journal_is_shown_until_a_signal(tmp_path: Path, signum: int, status: int) -> None:
    events, outcome = run_events()
    file = tmp_path / "run.journal"
    file.write_bytes(journal_of(events, outcome))
    with running([PROGRAM, "sniff", str(file), "--robots", "Robot1.*"], tmp_path / "run") as run:
        url = url_of(run)
        assert about(url)["chosen"] == ["Robot1.*"]
        assert len(run.ports()) == 1
        run.strike(signum)
        all_is_gone(run)
        assert run.status() == status


# robochoc solve --sniff


@pytest.mark.parametrize("runtime", ["simulator", pytest.param("processes", marks=pytest.mark.more)])
def test_a_run_is_shown_until_ctrl_c_and_its_result_is_told_before(teams: Path, tmp_path: Path, runtime: str) -> None:
    command = [PROGRAM, "solve", str(teams / "short"), "--runtime", runtime, "--withdraw", "--json", "--sniff"]
    with running(command, tmp_path / "run") as run:
        url = url_of(run)
        wait_until(lambda: "stays" in run.errors(), "it does not stay")
        verdict = json.loads(run.output())["verdict"]
        # The viewer reads what was written when somebody asks, a part at a time.
        wait_until(lambda: bool(about(url)["over"]), "the page does not know how it ended")
        assert about(url)["outcome"]["verdict"] == verdict  # type: ignore[index]
        run.strike(signal.SIGINT, group=True)
        all_is_gone(run)
        assert run.status() == 0


@pytest.mark.parametrize(
    ("signum", "watched"),
    [
        pytest.param(signal.SIGINT, True, marks=pytest.mark.more),
        pytest.param(signal.SIGTERM, False, marks=pytest.mark.more),
        pytest.param(signal.SIGKILL, True, marks=pytest.mark.more),
        pytest.param(signal.SIGINT, False, marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, True, marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, False, marks=pytest.mark.slow),
    ],
)
def test_whoever_ends_the_run_ends_the_viewer(teams: Path, tmp_path: Path, signum: int, *, watched: bool) -> None:
    runtime = "simulator" if watched else "processes"  # which leaves the viewer a core to itself
    command = [PROGRAM, "solve", str(teams / "long"), *LONG, "--protocol", "abt", "--sniff", "--runtime", runtime]
    with running(command, tmp_path / "run") as run:
        url = url_of(run)
        if watched:
            wait_until(lambda: int(str(about(url)["messages"])) > 0, "nothing is to be seen")
        assert viewer_of(run)
        run.strike(signum)
        all_is_gone(run)
        assert run.status() == (-signum if signum == signal.SIGKILL else 128 + signum)


def test_ctrl_c_never_ends_the_viewer_not_even_while_it_starts(tmp_path: Path) -> None:
    """It reaches the whole process group: Python would print a traceback before the viewer has said that it is deaf."""
    with (tmp_path / "journal").open("w+b") as journal, Viewer(journal.fileno()) as viewer:
        status = Path(f"/proc/{viewer._process.pid}/status").read_text()  # noqa: SLF001 - nothing else knows it
        masks = dict(re.findall(r"^(SigBlk|SigIgn):\s*([0-9a-f]+)$", status, re.MULTILINE))
        assert any(int(mask, 16) & 1 << (signal.SIGINT - 1) for mask in masks.values())


class PlayedViewer:
    """A viewer without a process."""

    url = "http://127.0.0.1:1/page/"
    is_gone = False

    def __init__(self, *_: object, **__: object) -> None:
        self.told: list[str] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.told.append("closed")

    def finish(self) -> None:
        self.told.append("finished")

    def wait(self) -> None:
        assert self.told == ["finished"]


def test_a_page_outlives_its_run_and_a_run_its_page(teams: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.sniffer.viewer.Viewer", PlayedViewer)
    failed = robochoc_within("solve", teams / "short", "--sniff", "--kill", "Robot2.2@0")
    assert failed.returncode == 4
    assert f"{PlayedViewer.url} stays until Ctrl-C\n" in failed.stderr
    monkeypatch.setattr(PlayedViewer, "is_gone", True)
    done = robochoc_within("solve", teams / "short", "--sniff", "--runtime", "simulator")
    assert (done.returncode, "no solution" in done.stdout) == (0, True)
    assert "the page is gone: its process ended during the run, which continued without it\n" in done.stderr


def robot_of(run: Run, viewer: int) -> int:
    """A robot's process. Robots are children of the run, as the viewer is."""
    return next(pid for pid in run.robots() if pid != viewer)


@pytest.mark.more
def test_a_run_goes_on_without_its_viewer_and_says_so(teams: Path, tmp_path: Path) -> None:
    with running(
        [PROGRAM, "solve", str(teams / "long"), *LONG, "--protocol", "abt", "--sniff"], tmp_path / "run"
    ) as run:
        viewer = viewer_of(run)
        run.strike(signal.SIGKILL, viewer)
        wait_until(lambda: run.program("viewer") is None, "the viewer stays")
        run.wait_for_robots(10)
        run.strike(signal.SIGKILL, robot_of(run, viewer))
        all_is_gone(run)
        assert run.status() == 4, "it went on until a robot was lost"
        assert "the page is gone: its process ended during the run, which continued without it" in run.errors()


@pytest.mark.more
def test_a_page_outlives_a_run_that_has_failed(teams: Path, tmp_path: Path) -> None:
    with running(
        [PROGRAM, "solve", str(teams / "long"), *LONG, "--protocol", "abt", "--sniff"], tmp_path / "run"
    ) as run:
        url = url_of(run)
        viewer = viewer_of(run)
        run.wait_for_robots(10)
        run.strike(signal.SIGKILL, robot_of(run, viewer))
        wait_until(lambda: "stays" in run.errors(), "it does not stay")
        wait_until(lambda: bool(about(url)["over"]), "the page does not know")
        run.strike(signal.SIGINT)
        all_is_gone(run)
        assert run.status() == 4


def test_an_invalid_team_has_no_page(tmp_path: Path) -> None:
    folder = tmp_path / "team"
    folder.mkdir()
    (folder / "Robot1.xml").write_text("<robot/>")
    done = robochoc_within("solve", folder, "--sniff")
    assert done.returncode == 1
    assert "http://" not in done.stderr


def test_patterns_may_be_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    for words, sniff in [
        (["team", "--sniff"], ""),
        (["--sniff", "tests", "--json"], ""),
        (["team", "--sniff", "Robot3.1,Robot2.*"], "Robot3.1,Robot2.*"),
        (["team", "--sniff=Robot1.?", "--json"], "Robot1.?"),
        (["team", "--sniff", "--json"], ""),
        (["team"], None),
    ]:
        monkeypatch.chdir(ROOT)
        assert isinstance(solve, SolveCommand)
        assert solve.make_context("solve", list(words)).params["sniff"] == sniff
