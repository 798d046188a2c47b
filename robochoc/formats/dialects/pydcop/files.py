"""The files of one problem: the problem in one or several files, a distribution, and a scenario."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, MistakeError, encodable
from robochoc.formats.yaml_tree import MAX_BYTES, Node, Read, Repeated, read_yaml, root_keys
from robochoc.system.lazy_dataclass import dataclass

_SECTION = re.compile(r"""^["']?([a-z_]+)["']?[ \t]*:""", re.MULTILINE)
_PROBLEM = {"domains", "variables", "constraints", "agents", "objective", "external_variables", "distribution_hints"}


@dataclass(frozen=True)
class SourceText:
    """The text of one or several files that are read as one.

    Attributes:
        files: The files, each with the number of lines before it.
        text: The text.
    """

    files: tuple[tuple[Path, int], ...]
    text: str

    def read(self, read: Callable[[Node], Read], repeated: Repeated) -> Read:
        """Return the result of `read` for the text. Raises `InvalidInputError` for a part that `read` does not use."""
        with self.located():
            return read_yaml(self.text, read, repeated=repeated)

    @contextmanager
    def located(self) -> Iterator[None]:
        """Turn a `MistakeError` raised inside into an `InvalidInputError` with the file and its line."""
        try:
            yield
        except MistakeError as mistake:
            path, line = self.place(mistake.line)
            raise InvalidInputError([Diagnostic(path, line, mistake.message, mistake.hint)]) from None

    def place(self, line: int) -> tuple[str, int]:
        """Return the file that contains a line of the text, and the line number in that file."""
        found, before = next(((path, start) for path, start in reversed(self.files) if start < line), self.files[0])
        return encodable(str(found)), max(0, line - before)


@dataclass(frozen=True)
class ProblemFiles:
    """The files of a problem.

    Attributes:
        problem: The problem, in one or several files.
        distribution: The variables that each agent hosts, if there is such a file.
        scenario: The events, if there is such a file.
    """

    problem: SourceText
    distribution: SourceText | None
    scenario: SourceText | None


def sections(text: str) -> set[str]:
    """Return the keys of the root mapping: at the beginning of lines, or in braces (as in JSON)."""
    return root_keys(text) if _is_in_braces(text) else set(_SECTION.findall(text))


def _is_in_braces(text: str) -> bool:
    for line in text.split("\n"):
        content = line.strip().removeprefix("---").lstrip()
        if content and not content.startswith("#"):
            return content.startswith("{")
    return False


def read_files(paths: Sequence[Path]) -> ProblemFiles:
    """Read the files at `paths`, and sort them by content. Raises `InvalidInputError`."""
    texts: dict[str, list[tuple[Path, str]]] = {"problem": [], "distribution": [], "scenario": []}
    total = 0
    for path in paths:
        text = file_text(path)
        total += len(text)
        if total > MAX_BYTES:
            what = f"and the files before it have more than {MAX_BYTES // 2**20} MiB together"
            raise _invalid(path, what, "import a smaller problem")
        texts[_kind(text)].append((path, text))
    if not texts["problem"]:
        raise _invalid(
            paths[0],
            "is not a problem but a distribution or a scenario",
            "import it together with the problem: robochoc import PROBLEM FILE -o FOLDER",
        )
    for kind in ("distribution", "scenario"):
        if len(texts[kind]) > 1:
            raise _invalid(texts[kind][1][0], f"is a second {kind}", f"import one {kind}")
    return ProblemFiles(
        _join(texts["problem"]),
        _join(texts["distribution"]) if texts["distribution"] else None,
        _join(texts["scenario"]) if texts["scenario"] else None,
    )


def _kind(text: str) -> str:
    names = sections(text)
    if not names & _PROBLEM:
        if "events" in names:
            return "scenario"
        if "distribution" in names:
            return "distribution"
    return "problem"


def _join(texts: Sequence[tuple[Path, str]]) -> SourceText:
    files, lines, parts = [], 0, []
    for path, text in texts:
        ended = text if text.endswith("\n") else f"{text}\n"
        files.append((path, lines))
        parts.append(ended)
        lines += ended.count("\n")
    return SourceText(tuple(files), "".join(parts))


def file_text(path: Path) -> str:
    """Return the text in the file at `path`. Raises `InvalidInputError`."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise _invalid(path, f"cannot be read: {error.strerror}", "check the path and its permissions") from None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _invalid(path, "is not UTF-8", "save it in UTF-8") from None


def _invalid(path: Path, message: str, hint: str) -> InvalidInputError:
    return InvalidInputError([Diagnostic(encodable(str(path)), 0, message, hint)])
