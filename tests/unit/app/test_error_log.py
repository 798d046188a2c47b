"""What goes wrong unforeseen is kept in a file, and told in a line: no traceback reaches the terminal."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("nicegui")

from robochoc.app import error_log
from robochoc.app.error_log import ERRORS, log_errors_to
from robochoc.app.log import ERROR_LOG, USER_LOG, error_text
from robochoc.app.sketch.edits import EditError

_LOGGERS = ("nicegui", "socketio", "socketio.server", "engineio", "engineio.server", "asyncio", "uvicorn",
            "uvicorn.error", "uvicorn.access", "uvicorn.asgi", USER_LOG.name, ERROR_LOG.name)  # fmt: skip


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder in which errors are kept, as long as the test runs."""
    before = {name: ([*logging.getLogger(name).handlers], logging.getLogger(name).propagate) for name in _LOGGERS}
    monkeypatch.setattr("nicegui.app.on_exception", lambda _: None)
    monkeypatch.setattr(error_log, "MOST_BYTES", 1 << 16)
    log_errors_to(tmp_path)
    yield tmp_path
    for name, (handlers, propagate) in before.items():
        logger = logging.getLogger(name)
        for handler in logger.handlers:
            handler.close()
        logger.handlers[:], logger.propagate = handlers, propagate


def _fail(name: str, message: str = "hostile") -> None:
    logging.getLogger(name).error("it failed", exc_info=ValueError(message))


@pytest.mark.parametrize("name", ["nicegui", "socketio.server", "engineio.server", "asyncio", "uvicorn.error"])
def test_a_traceback_goes_to_the_file_and_one_line_to_the_terminal(
    kept: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    for _ in range(3):
        _fail(name)
    out, err = capfd.readouterr()
    assert (out, err.count("\n"), "Traceback" in err, str(kept / ERRORS) in err) == ("", 1, False, True)
    assert (kept / ERRORS).read_text(encoding="utf-8").count("ValueError: hostile") == 3


def test_an_error_cannot_steer_the_terminal_nor_fill_the_disk(kept: Path) -> None:
    for _ in range(30):
        _fail("nicegui", "\x1b[2J\u202e" + "x" * 100_000)
    files = [*kept.iterdir()]
    assert sorted(file.name for file in files) == [ERRORS, f"{ERRORS}.1"]
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert len(text) <= error_log.MOST_BYTES + 2 * error_log.MOST_CHARACTERS
        assert all(letter.isprintable() or letter == "\n" for letter in text)


def test_what_users_must_know_is_told_each_time(kept: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        USER_LOG.error("not saved: %s", "\x1b[2J")
    assert capfd.readouterr().err == "not saved: \\x1b[2J\n" * 2
    assert not (kept / ERRORS).exists()


def test_a_file_that_cannot_be_written_is_no_error(kept: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (kept / ERRORS).mkdir()
    _fail("nicegui")
    assert "Traceback" not in capfd.readouterr().err


def test_the_page_says_what_somebody_can_understand() -> None:
    assert error_text(EditError("app.removed")).startswith("This team was removed")
    assert "No space left" in error_text(OSError(28, "No space left on device"))
    assert "<b>" not in error_text(ValueError("<b>secret</b>"))
