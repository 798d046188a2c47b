"""Commands and code that stand on pages of the documentation: read, run, and held against what the page says of them.

A fenced block of the language `sh` or `console` has commands, one of `python` code; a `text` block that follows is what
they print. In `console` blocks commands begin with `$ ` and their output stands between them. A block with a title is a
file of that name. In an output `...` stands for any text; seconds, sizes of files and the width of columns may differ,
and so may whether something is faster or slower than real time.
A command ends with status 0, or with what `# exit status N` behind it says.

A comment before a block says more of it, `<!-- snippet: WORDS -->`, of these words:

- `not run: REASON`: the block cannot be run by a test;
- `slow`: in `make test-slow` only;
- `needs MODULE`: only where that module is installed;
- `script`: the commands are one script of the shell;
- `background`: the same, and it runs on beside the blocks that follow, until it ends by itself.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from tests.support.limits import HANG_S
from tests.support.program import robochoc_within

_FENCE = re.compile(
    r"(?:^ *<!-- snippet: (?P<words>.*?) -->\n+)?"
    r'^(?P<indent> *)```(?P<kind>\w*)(?: title="(?P<title>[^"]+)")?[^\n]*\n'
    r"(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
_STATUS = re.compile(r"\s+# exit status (\d)$")
_VARIES = re.compile(r"\b\d[\d,]*(\.\d+)?(?= (?:seconds|s|ms|MB|MiB)\b)")
_SPEED = re.compile(r"\b\d[\d,]*(\.\d+)? times (?:as fast as|slower than)(?= real time\b)")
_SERVES = re.compile(r"--sniff\b|--serve\b|--watch\b|robochoc sniff (?!.*--no-page)")
_ALONE = {"network", "master", "robot", "directory"}
"""What leaves threads behind is run in a process of its own."""
_LONG_S = 2 * HANG_S
"""A command may wait for several events."""
_INTERRUPTED = 130
"""The status of a program that Ctrl-C has ended, which is right where nothing else ends it."""


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: the line on which it begins, its language, its text, the comment's words, its title."""

    line: int
    kind: str
    text: str
    words: str = ""
    title: str = ""

    @property
    def runs(self) -> bool:
        """Return whether tests run it."""
        return self.kind in {"sh", "console", "python"} and not self.words.startswith("not run: ")


class Step(NamedTuple):
    """What is run at once, and what it is said to print, or None if the page does not say; or a file to write."""

    line: int
    kind: str
    code: str
    printed: str | None
    words: str


def blocks_of(text: str) -> list[Block]:
    """Return the fenced blocks of a page."""
    found = []
    for match in _FENCE.finditer(text):
        depth = len(match["indent"])
        lines = "".join(line[depth:] if line.strip() else line for line in match["text"].splitlines(keepends=True))
        line = text.count("\n", 0, match.start("kind")) + 1
        found.append(Block(line, match["kind"], lines, match["words"] or "", match["title"] or ""))
    return found


def steps_of(text: str) -> Iterator[Step]:
    """Yield what a page has tests run, in its order."""
    blocks = blocks_of(text)
    for block, following in zip(blocks, [*blocks, Block(0, "", "")][1:], strict=True):
        printed = following.text if following.kind == "text" else None
        if block.title:
            yield Step(block.line, "file", block.text, None, block.title)
        elif not block.runs:
            continue
        elif block.kind == "console":
            yield from _console(block)
        elif block.kind == "python" or {"script", "background"} & {*block.words.split()}:
            yield Step(block.line, block.kind, block.text, printed, block.words)
        else:
            commands = block.text.replace("\\\n", " ").strip().splitlines()
            for number, command in enumerate(commands):
                last = number == len(commands) - 1
                if command.strip() and not command.startswith("#"):
                    yield Step(block.line + number + 1, "sh", command, printed if last else None, block.words)


def _console(block: Block) -> Iterator[Step]:
    parts = re.split(r"^\$ ", block.text.replace("\\\n", " "), flags=re.MULTILINE)
    assert not parts[0].strip(), f"line {block.line}: a console block begins with a command"
    if "background" in block.words:
        script = "\n".join(part.partition("\n")[0] for part in parts[1:])
        yield Step(block.line, "sh", script, parts[-1].partition("\n")[2] or None, block.words)
        return
    for part in parts[1:]:
        command, _, printed = part.partition("\n")
        yield Step(block.line, "sh", command, printed if printed.strip() else None, block.words)


def agrees(said: str, printed: str) -> bool:
    """Return whether a page's text stands for what was printed."""
    wanted, got = (_plain(text) for text in (said, printed))
    pattern = "".join(".*" if part == "..." else re.escape(part) for part in re.split(r"(\.\.\.)", wanted))
    return re.fullmatch(pattern, got, re.DOTALL) is not None


def _plain(text: str) -> str:
    lines = [" ".join(line.split()) for line in text.strip().splitlines()]
    return _SPEED.sub("N times as fast as", _VARIES.sub("N", "\n".join(lines)))


# Running


class Done(NamedTuple):
    """How a step ended."""

    status: int
    output: str


class Reader:
    """A reader of a page, in a folder of their own: `run` does a step, `finish` waits for what runs in the background.

    `said` are texts of the page and what stands for them here, such as addresses and ports.
    """

    def __init__(self, folder: Path, environment: Mapping[str, str], said: Mapping[str, str]) -> None:
        self._folder, self._environment, self._said = folder, {**environment}, said
        self._names: dict[str, object] = {"__name__": "__main__"}
        self._background: list[tuple[Step, subprocess.Popen[str]]] = []

    def run(self, step: Step) -> None:
        """Do one step, and compare what it prints."""
        if step.kind == "file":
            (self._folder / step.words).parent.mkdir(parents=True, exist_ok=True)
            (self._folder / step.words).write_text(self._here(step.code))
            return
        if "background" in step.words:
            self._background.append((step, self._started(self._here(step.code))))
            return
        status = _STATUS.search(step.code) if step.kind == "sh" else None
        done = self._python(step) if step.kind == "python" else self._command(self._here(step.code))
        self._compare(step, done, int(status[1]) if status else 0)

    def finish(self) -> None:
        """Wait for what runs in the background, the last that was started first, and compare what it has printed."""
        for step, process in reversed(self._background):
            output, _ = process.communicate(timeout=_LONG_S)
            self._compare(step, Done(process.returncode, output), 0)
        self._background.clear()

    def stop(self) -> None:
        """End what still runs in the background."""
        for _, process in self._background:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
                process.communicate(timeout=_LONG_S)

    def _here(self, code: str) -> str:
        for said, here in self._said.items():
            code = code.replace(said, here)
        return _STATUS.sub("", code)

    def _compare(self, step: Step, done: Done, status: int) -> None:
        where = f"line {step.line}: {step.code.strip()}"
        output = done.output
        for said, here in self._said.items():
            output = output.replace(here, said) if said in step.code else output
        assert done.status == status, f"{where}\nended with status {done.status}\n{output}"
        if step.printed is not None:
            assert agrees(step.printed, output), f"{where}\nsaid:\n{step.printed}\nprinted:\n{output}"

    def _python(self, step: Step) -> Done:
        """Run code in this process; what one block of a page has defined the next ones may use."""
        output = io.StringIO()
        with redirect_stdout(output), redirect_stderr(output):
            exec(compile(self._here(step.code), "<page>", "exec"), self._names)  # noqa: S102 - our own pages
        return Done(0, output.getvalue())

    def _command(self, command: str) -> Done:
        if _SERVES.search(command):
            return self._served(command)
        words = self._words(command)
        if words is None:
            return self._shell(["sh", "-c", command])
        program, target = words
        done = robochoc_within(*program)
        if target:
            (self._folder / target).write_text(done.stdout)
        return Done(done.returncode, ("" if target else done.stdout) + done.stderr)

    def _words(self, command: str) -> tuple[list[str], str] | None:
        """Return the words of a plain call of the program and the file that takes its output, or None for a shell."""
        if "\n" in command.strip():
            return None
        words = shlex.split(command, comments=True)
        target = ""
        if len(words) > 2 and words[-2] == ">":
            *words, _, target = words
        if words[:1] != ["robochoc"] or {"|", "&", "&&", ">", "<", ";"} & {*words} or _ALONE & {*words}:
            return None
        return words[1:], target

    def _shell(self, words: list[str]) -> Done:
        done = subprocess.run(
            words,
            cwd=self._folder,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=_LONG_S,
            check=False,
        )
        return Done(done.returncode, done.stdout)

    def _started(self, script: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["sh", "-ec", script],
            cwd=self._folder,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def _served(self, command: str) -> Done:
        """Run a command that goes on until Ctrl-C; press that once it has said where its page is, and what came out."""
        awaited = {"http://127.0.0.1", *(["NCCCs"] if "robochoc solve" in command else [])}
        process = self._started(f"exec {command}")
        assert process.stdout
        lines = []
        for line in process.stdout:
            lines.append(line)
            if all(words in "".join(lines) for words in awaited):
                os.kill(process.pid, signal.SIGINT)
                break
        rest, _ = process.communicate(timeout=_LONG_S)
        return Done(process.returncode % _INTERRUPTED, "".join(lines) + rest)
