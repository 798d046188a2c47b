"""What several test files begin with."""

from __future__ import annotations

import signal
import sys
import tempfile
import threading
from collections.abc import Iterator
from multiprocessing.util import get_temp_dir
from pathlib import Path
from secrets import token_hex
from typing import TYPE_CHECKING, Any

import pytest

from tests.support import leftovers
from tests.support.counted_clock import time_passes_at_each_look
from tests.support.examples import register_profiles, use_seed
from tests.support.large_pages import use_large_pages
from tests.support.leftovers import LeftoversOfFile

# Fixtures import what they need: `pytest tests/unit/model` starts without certificates, solvers and networks.
# ruff: noqa: PLC0415
if TYPE_CHECKING:
    from robochoc.authority.authority import Authority
    from tests.support.ace_stable import AceStable
    from tests.support.authorities import Clock, Seen
    from tests.support.authority_service import AuthorityService
    from tests.support.deployments import Deployment
    from tests.support.warm_programs import WarmPrograms

register_profiles()

# A shell script starts what it puts in the background (`make test &`) with SIGINT ignored. Every program that a test
# starts would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Random problems follow Hypothesis's seed."""
    use_seed(config.getoption("--hypothesis-seed"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, exitstatus: int, config: pytest.Config) -> None:
    """After a failure the seed stands at the end of the report."""
    seed = config.getoption("--hypothesis-seed")
    if exitstatus and seed:
        terminalreporter.write_line(f"random problems were drawn from seed {seed}: SEED={seed} repeats them")


def pytest_collection_finish() -> None:
    """All tests are there, with what they import: from now on processes are forked."""
    use_large_pages()


@pytest.fixture(autouse=True, scope="session")
def temporary_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A folder for temporary files that nobody else uses, and a mark that all processes of these tests inherit."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("t")
        patch.setenv("TMPDIR", str(folder))
        patch.setattr(tempfile, "tempdir", str(folder))
        get_temp_dir()  # multiprocessing makes one for this process, and keeps it
        mark = token_hex(8)
        patch.setenv(leftovers.MARK, mark)
        with leftovers.no_process_left(mark):
            yield mark


@pytest.fixture(autouse=True, scope="module")
def no_process_left(temporary_folder: str) -> Iterator[None]:
    with leftovers.no_process_left(temporary_folder):
        yield


@pytest.fixture(scope="module")
def may_stay() -> str:
    """Return the beginning of what the tests of a file may leave behind."""
    return "nothing"


@pytest.fixture(autouse=True, scope="module")
def leftovers_of_file(no_process_left: None, may_stay: str) -> Iterator[LeftoversOfFile]:
    del no_process_left
    of_file = LeftoversOfFile(may_stay)
    yield of_file
    of_file.check()


@pytest.fixture(autouse=True)
def nothing_left_behind(leftovers_of_file: LeftoversOfFile) -> Iterator[None]:
    """No test leaves a thread, a process, a descriptor, a port or a file behind."""
    with leftovers_of_file.of_test():
        yield


@pytest.fixture(autouse=True)
def no_protocol_left_registered() -> Iterator[None]:
    """The protocols that a test registers end with it: other tests expect those of installed packages alone."""
    registry = sys.modules.get("robochoc.run.registry")
    before = {**registry.REGISTERED} if registry else {}
    yield
    if registry := sys.modules.get("robochoc.run.registry"):
        registry.REGISTERED.clear()
        registry.REGISTERED.update(before)


@pytest.fixture
def quick_encryption(monkeypatch: pytest.MonkeyPatch) -> None:
    """Protocols encrypt in a group of small elements, in which no secret is safe, or share in the smallest field."""
    from robochoc.protocols.private.p_dsa import PDSA, PDSASettings
    from robochoc.protocols.private.p_maxsum import PMaxSum, PMaxSumSettings
    from robochoc.protocols.private.p_mgm import PMGM
    from robochoc.protocols.private.pc_syncbb import PCSyncBB, PCSyncBBSettings
    from robochoc.protocols.private.rerooting import RerootingProtocol
    from robochoc.protocols.private.shared_search import SearchSettings
    from tests.support.toy_group import ToyGroup

    monkeypatch.setattr(RerootingProtocol, "group", ToyGroup)
    monkeypatch.setattr(PCSyncBB, "settings", PCSyncBBSettings(bits=31))
    monkeypatch.setattr(PDSA, "settings", PDSASettings(cycles=4, bits=31))
    monkeypatch.setattr(PMGM, "settings", SearchSettings(cycles=4, bits=31))
    monkeypatch.setattr(PMaxSum, "settings", PMaxSumSettings(cycles=2, bits=31))


@pytest.fixture
def a_second_a_look() -> Iterator[None]:
    """Let a second pass whenever somebody looks at the clock: so as much is done on every machine."""
    with time_passes_at_each_look():
        yield


@pytest.fixture
def four(tmp_path: Path) -> Path:
    from robochoc.formats import write_team
    from robochoc.generators.queens3d import queens3d

    folder = tmp_path / "queens3d-4"
    write_team(queens3d(4), folder)
    return folder


@pytest.fixture
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files with short names, in an empty folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session")
def warm() -> Iterator[WarmPrograms]:
    from tests.support.warm_programs import WarmPrograms

    with leftovers.shared_by_tests():
        programs = WarmPrograms()
    with programs:
        yield programs


@pytest.fixture
def site(tmp_path: Path, warm: WarmPrograms) -> Iterator[Deployment]:
    from tests.support.deployments import Deployment

    with Deployment(tmp_path, warm=warm) as site:
        yield site


@pytest.fixture(autouse=True, scope="session")
def cache_of_their_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests neither use nor fill the cache of whoever runs them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(autouse=True, scope="session")
def one_compiler_in_java(request: pytest.FixtureRequest) -> Iterator[None]:
    """Java's second compiler takes more time than it saves, but for the long searches of slow tests."""
    with pytest.MonkeyPatch.context() as patch:
        if "not slow" in request.config.option.markexpr:
            patch.setenv("JAVA_TOOL_OPTIONS", "-XX:TieredStopAtLevel=1")
        yield


@pytest.fixture
def clock() -> Clock:
    from tests.support.authorities import Clock

    return Clock()


@pytest.fixture
def seen() -> Seen:
    from tests.support.authorities import Seen

    return Seen()


@pytest.fixture
def authority(tmp_path: Path, clock: Clock, seen: Seen) -> Authority:
    from robochoc.authority.authority import Authority

    return Authority.create(tmp_path / "authority", clock=clock, observer=seen)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[AuthorityService]:
    from tests.support.authority_service import AuthorityService, open_files

    before = threading.active_count(), open_files()
    desk = AuthorityService(tmp_path / "authority")
    with desk.server:
        yield desk
    assert (threading.active_count(), open_files()) == before, "nothing is left behind"


@pytest.fixture(scope="session")
def ace_stable() -> Iterator[AceStable]:
    from tests.support.ace_stable import AceStable

    stable = AceStable()
    yield stable
    stable.close()


@pytest.fixture
def warm_ace(ace_stable: AceStable) -> Iterator[None]:
    """There is a process of ACE before the test begins, so that it does not count in the test's time."""
    ace_stable.warm()
    with ace_stable.lent():
        yield


@pytest.fixture
def shared_solvers(ace_stable: AceStable) -> Iterator[None]:
    """Solvers take over each other's processes: ACE and OR-Tools are started once for all tests of a worker."""
    with ace_stable.lent():
        yield


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, by Playwright. While it is there, no test may run an event loop in the main thread."""
    from tests.support.browser_pages import chromium

    with chromium() as browser:
        yield browser
