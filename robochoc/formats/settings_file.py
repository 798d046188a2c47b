"""Small YAML files with settings, such as fleet files: read with limits, and every error has its line."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

from robochoc.formats.diagnostics import MistakeError, on_one_line, shortened
from robochoc.formats.yaml_tree import Node, read_yaml, scalar_text

BYTES_MAX = 64 * 1024
"""The maximum size of a file with settings, in bytes."""
_LARGE = 10**9

Settings = TypeVar("Settings")


def read_settings(
    path: Path, make: Callable[[Node], Settings], name: str, expected: str, hint: str, failed: type[Exception]
) -> Settings:
    """Read the file at `path`, and return its content as converted by `make`.

    Args:
        path: The file.
        make: Converts the content. Raises `MistakeError`.
        name: The kind of the file, such as `a fleet file`.
        expected: A hint for unknown entries.
        hint: A hint for a missing file.
        failed: The exception to raise. Its message has the file, the line, the error and a hint.
    """
    try:
        if path.is_fifo():  # opening a pipe would wait for a writer
            content = None
        else:
            with path.open("rb") as file:
                content = file.read(BYTES_MAX + 1)
    except OSError as error:
        raise failed(on_one_line(f"{path}: {error.strerror}; {hint}")) from None
    if content is None:
        raise failed(on_one_line(f"{path}: is not a file; {hint}"))
    if len(content) > BYTES_MAX:
        raise failed(on_one_line(f"{path}: {name} has at most {BYTES_MAX:,} bytes"))
    try:
        return read_yaml(content.decode(), make, expected)
    except UnicodeDecodeError:
        raise failed(on_one_line(f"{path}: is not UTF-8 text")) from None
    except MistakeError as mistake:
        where = f"{path}:{mistake.line}" if mistake.line else f"{path}"
        raise failed(on_one_line(f"{where}: {mistake.message}; {mistake.hint}")) from None


def check_mapping(node: Node, what: str) -> None:
    """Raise `MistakeError` if `node` is not a mapping."""
    if not node.is_mapping:
        raise MistakeError(f"{what} is not a mapping", "expected lines of NAME: VALUE", node.line)


def number_at(root: Node, name: str, usual: float, least: float, most: float) -> float:
    """Return the number in the entry `name`, or `usual` without this entry. Raises `MistakeError`."""
    node = root.get(name)
    if node is None:
        return usual
    found = decimal(node)
    if found is None or not least <= found <= most:
        given = shortened(scalar_text(node.scalar))
        raise MistakeError(f"'{name}' is {given!r}", f"expected {least:g} to {most:,g}", node.line)
    return found


def decimal(node: Node) -> float | None:
    """Return the number in `node`; None if there is none, or a very large one."""
    value = node.scalar
    if isinstance(value, bool) or not isinstance(value, int | Fraction):
        return None
    return float(value) if -_LARGE <= value <= _LARGE else None
