"""Read the domains of pyDCOP's files: integers stay integers, all other values become symbols."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

from robochoc.formats.definitions import MAX_VALUES, check_domain
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.dialect import NameMap
from robochoc.formats.dialects.exact_costs import xml_name
from robochoc.formats.names import check_integer
from robochoc.formats.yaml_tree import Node, Scalar, scalar_text
from robochoc.model.constraint import Domain
from robochoc.system.lazy_dataclass import dataclass

_HINT = "write values: [R, G] or [0..4]"


@dataclass(frozen=True)
class DomainValues:
    """The values of a domain, as written in the file and as integers.

    Attributes:
        domain: The domain in the team.
        scalars: The values in the file, by their integers in the team.
    """

    domain: Domain
    scalars: Mapping[int, Scalar]

    @cached_property
    def codes(self) -> dict[str, int]:
        """The integers in the team, by the words in tables of the file: Python's `str` of the values."""
        return {scalar_text(value): code for code, value in self.scalars.items()}

    @property
    def kind(self) -> type | None:
        """The common type of all values, or None if they have several types."""
        kinds = {type(value) for value in self.scalars.values()}
        return kinds.pop() if len(kinds) == 1 else None


class Domains:
    """The domains of a problem. All symbols have a common numbering."""

    def __init__(self, nodes: Mapping[str, Node]) -> None:
        """Read domains. The keys are their names. Raises `MistakeError`."""
        scalars = {name: _scalars(name, node) for name, node in nodes.items()}
        self._symbols = NameMap()
        symbolic = {name for name, values in scalars.items() if not _are_integers(values)}
        labels = dict.fromkeys(self._label(value) for name in scalars if name in symbolic for value in scalars[name])
        self._places = {label: place for place, label in enumerate(labels)}
        self.all = {
            name: self._named(name, values) if name in symbolic else _numbers(name, values, nodes[name].line)
            for name, values in scalars.items()
        }

    @property
    def renamed(self) -> Iterable[tuple[str, str]]:
        """Return the symbols with new names, each with its original."""
        return self._symbols.originals.items()

    def _label(self, value: Scalar) -> str:
        return self._symbols.allowed(scalar_text(value))

    def _named(self, name: str, values: Iterable[Scalar]) -> DomainValues:
        scalars = {self._places[self._label(value)]: value for value in values}
        ranges = tuple(range(code, code + 1) for code in sorted(scalars))
        return DomainValues(Domain(xml_name(name), ranges, tuple(self._places)), scalars)


def _numbers(name: str, values: Iterable[Scalar], line: int) -> DomainValues:
    numbers = sorted({value for value in values if isinstance(value, int)})
    domain = Domain(xml_name(name), tuple(range(value, value + 1) for value in numbers))
    try:
        check_domain(domain)
    except MistakeError as mistake:
        raise MistakeError(mistake.message, mistake.hint, line) from None
    return DomainValues(domain, {value: value for value in numbers})


def _are_integers(values: Iterable[Scalar]) -> bool:
    return all(isinstance(value, int) and not isinstance(value, bool) for value in values)


def _scalars(name: str, node: Node) -> list[Scalar]:
    values = node.needed("values", f"the domain '{shortened(name)}'", _HINT)
    if not values.items:
        raise MistakeError(f"the domain '{shortened(name)}' has no values", _HINT, node.line)
    for key in ("type", "initial_value"):
        if remark := node.get(key):
            remark.skip()  # a remark for users, and a value that pyDCOP itself ignores
    for one in values.items:
        if not one.is_scalar:
            what = f"the domain '{shortened(name)}' has a list or a mapping as a value"
            raise MistakeError(what, "write numbers and names", one.line)
    found = [one.scalar for one in values.items]
    if len(found) == 1 and isinstance(found[0], str) and ".." in found[0]:
        return list(_range(found[0], values.line))
    if len(found) > MAX_VALUES:
        what = f"the domain '{shortened(name)}' has more than {MAX_VALUES} values"
        raise MistakeError(what, "use a smaller domain", node.line)
    seen: dict[str, Scalar] = {}
    for value, one in zip(found, values.items, strict=True):
        known = seen.setdefault(scalar_text(value), value)
        if type(known) is not type(value):
            what = (
                f"the domain '{shortened(name)}' has two different values with the text {shortened(scalar_text(value))}"
            )
            raise MistakeError(what, "rename one of them", one.line)
    return found


def _range(text: str, line: int) -> range:
    first, _, last = text.partition("..")
    try:
        ends = int(first), int(last)
    except ValueError:
        raise MistakeError(f"'{shortened(text)}' is not a range", "write two integers: [0..4]", line) from None
    try:
        check_integer(ends[0])
        check_integer(ends[1])
    except MistakeError as mistake:
        raise MistakeError(mistake.message, mistake.hint, line) from None
    found = range(ends[0], ends[1] + 1)
    if not 0 < ends[1] - ends[0] + 1 <= MAX_VALUES:
        what = "is empty" if ends[1] < ends[0] else f"has more than {MAX_VALUES} values"
        raise MistakeError(f"the range {shortened(text)} {what}", f"write from 1 to {MAX_VALUES} values", line)
    return found
