"""The pages that lead through the code: files and functions are there, and the numbers of lines are true within 10 %.

`python -m tests.docs.test_reading_order` writes the numbers anew.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

from tests.support.program import ROOT

PAGES = [ROOT / "docs" / "explanation" / f"{name}.md" for name in ("way-of-a-run", "reading-order")]
TOLERANCE = 0.1
_ROW = re.compile(r"^\| .* \| (\d+) \|$")
_PATH = re.compile(r"\| `([a-z_/]+(?:\.py)?)` \|")
_FUNCTION = re.compile(r"\.py` \| `(\w+)` \|")


def lines_of(path: Path) -> int:
    """Return the number of lines of a file, or of all Python files of a folder."""
    files = path.rglob("*.py") if path.is_dir() else [path]
    return sum(len(file.read_text().splitlines()) for file in files)


def rows(page: str) -> Iterator[tuple[str, Path | None, int]]:
    """Yield each row that ends with a number of lines: its text, its file, and the number that is true."""
    total = 0
    for line in page.splitlines():
        if not _ROW.match(line):
            continue
        path = _PATH.search(line)
        if path is None:
            yield line, None, total
            continue
        file = ROOT / "robochoc" / path[1]
        number = lines_of(file)
        total += number
        yield line, file, number


def test_numbers_of_lines_are_true() -> None:
    for page in PAGES:
        found = list(rows(page.read_text()))
        assert len(found) > 30
        for line, _, number in found:
            said = int(line.rsplit("|", 2)[1])
            assert abs(said - number) <= TOLERANCE * number, f"{line}: now {number} (python -m {__name__})"


def test_files_and_functions_are_there() -> None:
    for page in PAGES:
        for line, file, _ in rows(page.read_text()):
            assert file is None or file.exists(), line
            function = _FUNCTION.search(line)
            if file and function:
                assert re.search(rf"^(class|def) {function[1]}\b", file.read_text(), re.MULTILINE), line


def rewrite() -> None:
    """Write the numbers anew."""
    for page in PAGES:
        text = page.read_text()
        for line, _, number in list(rows(text)):
            text = text.replace(line, re.sub(r"\d+ \|$", f"{number} |", line))
        page.write_text(text)


if __name__ == "__main__":
    argparse.ArgumentParser(description="Write the numbers of lines anew.").parse_args()
    rewrite()
