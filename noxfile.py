"""Every Python that robochoc is for: `make nox`, or `.venv/tools/bin/nox -s tests-3.13 -- tests/unit`.

An interpreter that is not on the path is skipped. What is installed is what `requirements/` has; `newest` installs the
newest instead that `pyproject.toml` allows.
"""

from __future__ import annotations

import nox

PYTHONS = ["3.11", "3.12", "3.13", "3.14"]
PACKAGES = ("repository", "unit/formats", "unit/model", "unit/journal", "unit/view", "unit/communication/arrays")
ON_TABLES_AND_BYTES = ("protocols/test_dpop.py", "protocols/test_hostile_messages.py")
SMOKE = [f"tests/{place}" for place in (*PACKAGES, *ON_TABLES_AND_BYTES)]
"""What `newest` runs when no tests are named: a part of each library that robochoc stands on, in a minute or two."""

nox.options.envdir = ".venv/nox"
nox.options.default_venv_backend = "venv"
nox.options.sessions = ["tests", "type", "lint"]
nox.options.error_on_missing_interpreters = False


def _install(session: nox.Session) -> None:
    session.install(
        "--require-hashes", "--only-binary", ":all:", "-r", "requirements/build.txt", "-r", "requirements/dev.txt"
    )
    session.install("--no-index", "--no-deps", "--no-build-isolation", "--editable", ".")


def _pytest(session: nox.Session, *words: str) -> None:
    session.run("pytest", "-n", "2", "--dist", "worksteal", *words)


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run `make test`, or the tests that are named."""
    _install(session)
    _pytest(session, *session.posargs)


@nox.session(python=PYTHONS)
def type(session: nox.Session) -> None:  # noqa: A001 - as make's
    """Run mypy, with this Python's version."""
    _install(session)
    session.run("mypy", "--python-version", str(session.python))


@nox.session(python=PYTHONS[0])
def lint(session: nox.Session) -> None:
    """Run ruff and import-linter."""
    _install(session)
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("lint-imports")


@nox.session
def newest(session: nox.Session) -> None:
    """Run tests with the newest versions that `pyproject.toml` allows."""
    session.install("--upgrade", "--editable", ".[dev]")
    _pytest(session, *(session.posargs or SMOKE))
