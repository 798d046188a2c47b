"""The cache of solved local problems: right, or not there; never wrong, and never in the way."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import QueensModel, QueensRobots, queens3d
from robochoc.model.problem import Robot
from robochoc.solver import cache as cache_module
from robochoc.solver.ace import AceProcess
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compile import Compilation, CompiledFrom, Compiler
from robochoc.solver.encoding import Codes, CodeTable, Network
from tests.support.cases import looped
from tests.support.limits import HANG_S
from tests.support.program import ROOT, robochoc_within
from tests.support.solver_networks import SMALL_NETWORK, SMALL_SOLUTIONS

OTHERS = (
    Network(((0, 1), (0, 1))),
    Network(((0, 1), (0, 2)), SMALL_NETWORK.tables),
    Network(((0, 1), (0, 1)), (CodeTable((0, 1), allowed=True, rows=((0, 0),)),)),
    Network(((0, 1), (0, 1)), (CodeTable((0, 1), allowed=False, rows=((0, 1),)),)),
    Network(((0, 1), (0, 1)), SMALL_NETWORK.tables, different=((0, 1),)),
)
WRITER = """
import sys
from pathlib import Path
from robochoc.solver.cache import SolutionCache
from tests.support.solver_networks import SMALL_NETWORK, SMALL_SOLUTIONS
cache = SolutionCache(Path(sys.argv[1]))
print("ready", flush=True)
sys.stdin.readline()
for _ in range(300):
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    assert cache.get(SMALL_NETWORK) == SMALL_SOLUTIONS
"""


def signed(body: bytes) -> bytes:
    """A cache file with this content, its digest being right."""
    return hashlib.blake2b(body, digest_size=32).digest() + body


def entry(path: Path, width: int, count: int, codes: bytes) -> bytes:
    """A cache file at `path` that says all this."""
    return signed(msgspec.msgpack.encode((path.stem, width, count, codes)))


def foreign(path: Path) -> bytes:
    """What the cache holds of another network, for which there are as many variables."""
    beside = SolutionCache(path.parent / "beside")
    beside.put(OTHERS[0], ((0, 0),))
    (other,) = beside.files()
    content = other.read_bytes()
    other.unlink()
    other.parent.rmdir()
    return content


def flipped(place: int) -> Callable[[Path], bytes]:
    """The file with one bit changed."""

    def damaged(path: Path) -> bytes:
        content = bytearray(path.read_bytes())
        content[place] ^= 1
        return bytes(content)

    return damaged


DAMAGES: dict[str, Callable[[Path], bytes]] = {
    "empty": lambda _: b"",
    "one byte": lambda _: b"x",
    "cut off": lambda path: path.read_bytes()[:-1],
    "cut off within the digest": lambda path: path.read_bytes()[:20],
    "longer": lambda path: path.read_bytes() + b"\0",
    "another digest": flipped(0),
    "another key": flipped(40),
    "another solution": flipped(-1),
    "garbage": lambda _: bytes(range(256)) * 9,
    "of another network": foreign,
    "signed garbage": lambda _: signed(bytes(range(256))),
    "signed nothing": lambda _: signed(b""),
    "signed, of another width": lambda path: entry(path, 1, 2, bytes(8)),
    "signed, fewer than it says": lambda path: entry(path, 2, 2, bytes(8)),
    "signed, half a number": lambda path: entry(path, 2, 1, bytes(7)),
    "signed, less than nothing": lambda path: entry(path, 2, -1, b""),
    "signed, very deep": lambda _: signed(b"\x91" * 100_000),
    "signed, with more that is very deep": lambda path: signed(
        b"\x95" + msgspec.msgpack.encode((path.stem, 2, 1, bytes(8)))[1:] + b"\x91" * 100_000
    ),
}


@pytest.fixture
def cache(tmp_path: Path) -> SolutionCache:
    return SolutionCache(tmp_path / "cache")


@pytest.fixture(scope="module")
def row() -> Robot:
    """A robot with private constraints that need a solver, and two local solutions."""
    return queens3d(4, QueensModel.PLANAR, QueensRobots.ROWS).robots[0]


@pytest.fixture
def rows(warm_ace: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A team's folder; the program's cache is at `home`, beside it."""
    del warm_ace
    folder = tmp_path / "rows"
    write_team(queens3d(4, QueensModel.PLANAR, QueensRobots.ROWS), folder)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return folder


def compiled(robot: Robot, cache: SolutionCache, ace: AceProcess) -> Compilation:
    """What compiling `robot` comes to, its time apart."""
    with Compiler(cache=cache, solver=ace) as compiler:
        return replace(compiler.compile(robot), seconds=0)


def sources(*words: object) -> list[str]:
    """Where the program says that robots' local solutions come from."""
    done = robochoc_within("compile", "--json", *words)
    assert (done.returncode, done.stderr) == (0, "")
    return [robot["source"] for robot in json.loads(done.stdout)["robots"]]


@pytest.mark.parametrize("solutions", [SMALL_SOLUTIONS, SMALL_SOLUTIONS[:1], ()])
def test_what_is_put_is_got(cache: SolutionCache, solutions: tuple[Codes, ...]) -> None:
    assert cache.get(SMALL_NETWORK) is None
    cache.put(SMALL_NETWORK, solutions)
    assert cache.get(SMALL_NETWORK) == solutions
    assert SolutionCache(cache.folder).get(replace(SMALL_NETWORK)) == solutions


def test_other_networks_are_not_known(cache: SolutionCache) -> None:
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    assert [cache.get(other) for other in OTHERS] == [None] * len(OTHERS)
    assert len({cache.key(network) for network in (SMALL_NETWORK, *OTHERS)}) == 1 + len(OTHERS)
    assert cache.get(SMALL_NETWORK) == SMALL_SOLUTIONS


@looped("damage", DAMAGES)
def test_a_damaged_file_is_removed(cache: SolutionCache, damage: str) -> None:
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    (path,) = cache.files()
    path.write_bytes(DAMAGES[damage](path))
    assert cache.get(SMALL_NETWORK) is None
    assert not list(cache.folder.iterdir())
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    assert cache.get(SMALL_NETWORK) == SMALL_SOLUTIONS


def test_every_bit_of_a_file_counts(cache: SolutionCache) -> None:
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    (path,) = cache.files()
    whole = path.read_bytes()
    for place in range(len(whole)):
        for bit in range(8):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :])
            assert cache.get(SMALL_NETWORK) is None, (place, bit)


@pytest.mark.parametrize("damage", ["empty", "cut off", "another solution", "garbage", "of another network"])
def test_a_robot_is_compiled_again_when_its_file_is_damaged(
    cache: SolutionCache, ace: AceProcess, row: Robot, damage: str
) -> None:
    first = compiled(row, cache, ace)
    assert (first.source, first.domain.total) == (CompiledFrom.ACE, 2)
    assert compiled(row, cache, ace) == replace(first, source=CompiledFrom.CACHE)
    (path,) = cache.files()
    whole = path.read_bytes()
    path.write_bytes(DAMAGES[damage](path))
    assert compiled(row, cache, ace) == first
    assert path.read_bytes() == whole
    assert compiled(row, cache, ace).source is CompiledFrom.CACHE


def test_another_version_has_other_files(cache: SolutionCache, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    monkeypatch.setattr(cache_module, "FORMAT", cache_module.FORMAT + 1)
    later = SolutionCache(cache.folder)
    assert later.key(SMALL_NETWORK) != cache.key(SMALL_NETWORK)
    assert later.get(SMALL_NETWORK) is None
    later.put(SMALL_NETWORK, SMALL_SOLUTIONS[:2])
    assert (cache.get(SMALL_NETWORK), later.get(SMALL_NETWORK)) == (SMALL_SOLUTIONS, SMALL_SOLUTIONS[:2])


def test_another_version_of_pycsp3_has_other_files(
    cache: SolutionCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, about = tmp_path / "first" / "pycsp3", tmp_path / "first" / "pycsp3-0.0.1.dist-info"
    for path, content in (
        (package / "__init__.py", ""),
        (package / "version.txt", "0.0.1"),
        (about / "METADATA", "Name: pycsp3\nVersion: 0.0.1\n"),
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    before = cache.key(SMALL_NETWORK)
    monkeypatch.syspath_prepend(str(package.parent))
    assert SolutionCache(cache.folder).key(SMALL_NETWORK) != before


def test_what_is_too_large_is_not_kept(cache: SolutionCache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache_module, "MAX_BYTES", 4 * 2 * len(SMALL_SOLUTIONS) - 1)
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    assert not cache.folder.exists()
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS[1:])
    assert cache.get(SMALL_NETWORK) == SMALL_SOLUTIONS[1:]


@pytest.mark.parametrize("place", ["file", "file/below"])
def test_a_folder_that_cannot_be_written_is_done_without(
    tmp_path: Path, ace: AceProcess, row: Robot, place: str
) -> None:
    (tmp_path / "file").write_text("in the way")
    cache = SolutionCache(tmp_path / place)
    cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
    assert cache.get(SMALL_NETWORK) is None
    for _ in range(2):
        found = compiled(row, cache, ace)
        assert (found.source, found.domain.total) == (CompiledFrom.ACE, 2)
    assert (list(cache.files()), cache.clear()) == ([], 0)
    assert (tmp_path / "file").read_text() == "in the way"


def test_a_folder_in_the_place_of_a_file_is_done_without(cache: SolutionCache, ace: AceProcess, row: Robot) -> None:
    compiled(row, cache, ace)
    (path,) = cache.files()
    path.unlink()
    path.mkdir()
    assert [compiled(row, cache, ace).source for _ in range(2)] == [CompiledFrom.ACE] * 2
    assert [found.name for found in cache.folder.iterdir()] == [path.name]


def test_threads_that_write_at_the_same_time_leave_one_whole_file(cache: SolutionCache) -> None:
    def write_and_read(_: int) -> bool:
        cache.put(SMALL_NETWORK, SMALL_SOLUTIONS)
        return cache.get(SMALL_NETWORK) == SMALL_SOLUTIONS

    with ThreadPoolExecutor(4) as threads:
        assert all(threads.map(write_and_read, range(200)))
    assert len(list(cache.folder.iterdir())) == 1


def test_processes_that_write_at_the_same_time_leave_one_whole_file(cache: SolutionCache) -> None:
    command = [sys.executable, "-c", WRITER, str(cache.folder)]
    pipe = subprocess.PIPE
    writers = [subprocess.Popen(command, stdin=pipe, stdout=pipe, cwd=ROOT) for _ in range(2)]
    try:
        for writer in writers:
            assert writer.stdout
            assert writer.stdout.readline() == b"ready\n"
        for writer in writers:
            assert writer.stdin
            writer.stdin.write(b"\n")
            writer.stdin.flush()
    finally:
        for writer in writers:
            writer.communicate(timeout=HANG_S)
    assert [writer.returncode for writer in writers] == [0, 0]
    assert [path.name for path in cache.folder.iterdir()] == [f"{cache.key(SMALL_NETWORK)}.solutions"]
    assert cache.get(SMALL_NETWORK) == SMALL_SOLUTIONS


def test_clearing_removes_the_cache_and_nothing_else(cache: SolutionCache) -> None:
    assert cache.clear() == 0
    for network in OTHERS:
        cache.put(network, ())
    (cache.folder / "letter.txt").write_text("mine")
    assert cache.clear() == len(OTHERS)
    assert [path.name for path in cache.folder.iterdir()] == ["letter.txt"]
    assert cache.get(OTHERS[0]) is None


def test_the_program_keeps_shows_and_clears_its_cache(rows: Path) -> None:
    home = rows.parent / "home" / "robochoc"
    assert robochoc_within("cache", "show").stdout == f"{home}: 0 problems, 0 bytes\n"
    assert sources("--ace", rows) == ["ace", "equal", "equal", "equal"]
    (path,) = home.iterdir()
    assert robochoc_within("cache", "show").stdout == f"{home}: 1 problem, {path.stat().st_size} bytes\n"
    assert sources(rows) == ["cache", "equal", "equal", "equal"]
    cleared = robochoc_within("cache", "clear")
    assert (cleared.returncode, cleared.stdout) == (0, f"{home}: 1 problem removed\n")
    assert not list(home.iterdir())
    assert robochoc_within("cache", "clear").stdout == f"{home}: 0 problems removed\n"


def test_without_the_cache_it_is_neither_used_nor_filled(rows: Path) -> None:
    assert sources("--ace", "--no-cache", rows) == ["ace", "equal", "equal", "equal"]
    assert robochoc_within("solve", "--no-cache", "--runtime", "simulator", rows).returncode == 0
    assert not (rows.parent / "home").exists()
    assert robochoc_within("solve", "--ace", "--runtime", "simulator", rows).returncode == 0
    assert len(list((rows.parent / "home" / "robochoc").iterdir())) == 1
    assert sources("--ace", "--no-cache", rows) == ["ace", "equal", "equal", "equal"]


def test_the_program_does_without_a_cache_that_it_cannot_have(rows: Path) -> None:
    home = rows.parent / "home"
    home.write_text("in the way")
    assert sources("--ace", rows) == ["ace", "equal", "equal", "equal"]
    assert robochoc_within("cache", "show").stdout == f"{home / 'robochoc'}: 0 problems, 0 bytes\n"
    assert robochoc_within("cache", "clear").returncode == 0
