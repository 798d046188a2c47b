"""What is locked (`requirements/`) is what `pyproject.toml` asks for: else say `make lock`."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.support.audit import verdict
from tests.support.program import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
NEEDS = {
    "run": [],
    "extras": ["network", "ros"],
    "dev": ["dev"],
    "docs": ["dev", "docs"],
}
"""The locks of robochoc's own requirements, and the extras that each has."""
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


def wanted(extras: list[str]) -> list[Requirement]:
    """Return the project's requirements with `extras`, and with the extras that these name."""
    optional = PROJECT["project"]["optional-dependencies"]
    found = [Requirement(line) for line in PROJECT["project"]["dependencies"]]
    for requirement in (Requirement(line) for extra in extras for line in optional[extra]):
        found += wanted(sorted(requirement.extras)) if requirement.name == "robochoc" else [requirement]
    return found


def entries(lock: Path) -> list[tuple[Requirement, int]]:
    """Return what a lock pins, and how many hashes each has."""
    lines = [line for line in lock.read_text().replace("\\\n", "").splitlines() if not line.lstrip().startswith("#")]
    return [(Requirement(line.split(" --hash")[0]), line.count("--hash=sha256:")) for line in lines]


def disagreements(needed: list[Requirement], lock: Path) -> list[str]:
    pinned = [pin for pin, _ in entries(lock)]
    found = []
    for need in needed:
        for python in PYTHONS:
            here = [
                pin
                for pin in pinned
                if canonicalize_name(pin.name) == canonicalize_name(need.name)
                and (pin.marker is None or pin.marker.evaluate({"python_full_version": f"{python}.0"}))
            ]
            versions = [str(pin.specifier).removeprefix("==") for pin in here]
            if not (len(versions) == 1 and need.specifier.contains(versions[0], prereleases=True)):
                found.append(f"{need} in {lock.name} for Python {python}: {versions}")
    return found


@pytest.mark.parametrize("name", NEEDS)
def test_the_locks_satisfy_pyproject(name: str) -> None:
    assert disagreements(wanted(NEEDS[name]), ROOT / f"requirements/{name}.txt") == [], "say: make lock"


def test_the_locks_of_the_build_and_of_tools_satisfy_pyproject() -> None:
    groups = PROJECT["dependency-groups"]
    assert set(PROJECT["build-system"]["requires"]) < set(groups["build"])
    for name in ("build", "tools"):
        needed = [Requirement(line) for line in groups[name]]
        assert disagreements(needed, ROOT / f"requirements/{name}.txt") == [], "say: make lock"


def test_every_pin_has_hashes_and_no_index_is_named() -> None:
    for lock in (ROOT / "requirements").glob("*.txt"):
        assert not re.search(r"://|^-", lock.read_text(), re.MULTILINE), lock
        for pin, hashes in entries(lock):
            assert hashes, (lock, pin)
            assert re.fullmatch(r"==[^,*]+", str(pin.specifier)), (lock, pin)


def test_no_two_locks_of_one_environment_differ() -> None:
    pins: dict[tuple[str, str], set[str]] = {}
    for name in ("build", *NEEDS):
        for pin, _ in entries(ROOT / f"requirements/{name}.txt"):
            pins.setdefault((pin.name, str(pin.marker)), set()).add(str(pin.specifier))
    assert {pin: versions for pin, versions in pins.items() if len(versions) > 1} == {}


# `make audit`

SOUND = {"name": "click", "version": "8.5.1", "vulns": []}
UNKNOWN = {"name": "lxml", "version": "6", "skip_reason": "Dependency not found on PyPI"}
KNOWN = {"name": "numpy", "version": "2", "vulns": [{"id": "PYSEC-1", "fix_versions": ["2.1", "3.0"]}]}


def test_what_the_audit_says() -> None:
    assert verdict([SOUND, SOUND]) == (0, ["1 packages have no known vulnerability"])
    assert verdict([SOUND, KNOWN, UNKNOWN]) == (
        1,
        ["numpy 2: PYSEC-1, mended in 2.1 or 3.0", "1 known vulnerabilities in 2 packages"],
    )


def test_who_could_not_be_asked_about_is_not_sound() -> None:
    assert verdict([SOUND, UNKNOWN]) == (2, ["1 packages have no known vulnerability; no answer about lxml"])
    assert verdict([UNKNOWN]) == (
        2,
        ["not audited: the vulnerability service answers about none of the 1 packages"],
    )
