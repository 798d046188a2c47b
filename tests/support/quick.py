"""`make quick`: the tests that a change touches, by imports, nearest first.

Changed is what differs from the commit where this branch left main, and what is not committed. The nearest tests are
the changed ones, then those that import a changed module, then those that do so over another module, and so on.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
MOST = 40
"""Test files to run."""


def changed_files(root: Path, base: str) -> list[str]:
    """Return the files that differ from the merge base with `base`, and new ones."""

    def git(*words: str) -> list[str]:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True)
        return done.stdout.splitlines()

    (start,) = git("merge-base", base, "HEAD")
    return [*git("diff", "--name-only", "--diff-filter=d", start), *git("ls-files", "--others", "--exclude-standard")]


def touched(graph: grimp.ImportGraph, changed: Iterable[str]) -> list[str]:
    """Return the test modules that import `changed` modules, nearest first; a package's own tests before others."""
    ring = {module for module in changed if module in graph.modules}
    packages = {f"tests.{of}{module.split('.')[1]}." for module in ring if "." in module for of in ("", "unit.")}
    seen, found = set(ring), list[str]()
    while ring:
        tests = [module for module in ring if module.rpartition(".")[2].startswith("test_")]
        found += sorted(tests, key=lambda test: (not test.startswith(tuple(packages)), test))
        ring = {user for module in ring for user in graph.find_modules_that_directly_import(module)} - seen
        seen |= ring
    return found


def main() -> int:
    """Run pytest for those tests, with what else the command line has for it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", default="main", help="the branch to compare with [main]")
    parser.add_argument("--most", type=int, default=MOST, help=f"test files to run [{MOST}]")
    options, words = parser.parse_known_args()
    graph = grimp.build_graph("robochoc", "tests", cache_dir=None)
    changed = [file.removesuffix(".py") for file in changed_files(ROOT, options.base) if file.endswith(".py")]
    names = [name.removesuffix("/__init__").replace("/", ".") for name in changed]
    found = touched(graph, names)
    files = [f"{module.replace('.', '/')}.py" for module in found[: options.most]]
    sys.stdout.write(
        f"{len(names)} modules changed; running {len(files)} of {len(found)} test files that import them\n"
    )
    sys.stdout.flush()
    command = [sys.executable, "-m", "pytest", *words, *files]
    return subprocess.run(command, cwd=ROOT, check=False).returncode if files else 0


if __name__ == "__main__":
    sys.exit(main())
