"""Read XCSP3 instances: variables, constraints with their groups and slides, and the objective."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path

from robochoc.formats.definitions import MAX_VALUES
from robochoc.formats.diagnostics import MistakeError, invalid_input
from robochoc.formats.dialects.dialect import MAX_FILE, ConversionNote, ImportOptions, ImportResult, NameMap
from robochoc.formats.dialects.xcsp3 import constraints, scheduling, tables
from robochoc.formats.dialects.xcsp3.constraint_element import Element, slide_scopes
from robochoc.formats.dialects.xcsp3.constraints import circuit
from robochoc.formats.dialects.xcsp3.document import check_root, ignore_remarks
from robochoc.formats.dialects.xcsp3.objective import post_objective
from robochoc.formats.dialects.xcsp3.posting import Posting, readable_number
from robochoc.formats.dialects.xcsp3.variables import Variables, domain_of, read_variables
from robochoc.formats.element_view import ElementView, open_xml
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Domain, ProblemKind, Variable
from robochoc.system.lazy_dataclass import dataclass

NAME = "xcsp3"

Kind = Callable[[Element, Posting], None]

KINDS: Mapping[str, Kind] = {
    "intension": constraints.intension,
    "allDifferent": constraints.all_different,
    "allEqual": constraints.all_equal,
    "ordered": constraints.ordered,
    "lex": constraints.lex,
    "sum": constraints.sum_of,
    "count": constraints.count,
    "nValues": constraints.n_values,
    "cardinality": constraints.cardinality,
    "minimum": constraints.extremum("min"),
    "maximum": constraints.extremum("max"),
    "minimumArg": constraints.index_of_extremum("min"),
    "maximumArg": constraints.index_of_extremum("max"),
    "channel": constraints.channel,
    "instantiation": constraints.instantiation,
    "clause": constraints.clause,
    "precedence": constraints.precedence,
    "knapsack": constraints.knapsack,
    "binPacking": constraints.bin_packing,
    "element": tables.element,
    "regular": tables.regular,
    "mdd": tables.mdd,
    "circuit": circuit,
    "noOverlap": scheduling.no_overlap,
    "cumulative": scheduling.cumulative,
}
"""The supported constraints of XCSP3-core, besides `extension`; others are refused by name."""

_SYMBOLIC = {"intension", "extension", "allDifferent", "allEqual", "instantiation"}
_WIDE = 4_000_000
"""A constraint with more combinations of values is reported, since the central solver makes no larger tables."""


def read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    """Return the problem in an XCSP3 file.

    Args:
        paths: The file.
        options: The options; without `owner` each variable gets its own robot.

    Raises:
        InvalidInputError: with all mistakes and unsupported parts, each with its line.
    """
    if len(paths) != 1:
        what = f"is one of {len(paths)} files, but an XCSP3 instance is one file"
        raise invalid_input(paths[0], what, "import one file at a time")
    (path,) = paths
    with open_xml(path, MAX_FILE, long_texts=True) as root:
        check_root(root)
        return _read_instance(root, path, options)


def _read_instance(root: ElementView, path: Path, options: ImportOptions) -> ImportResult:
    variables = read_variables(root.child("variables"))
    root.report.finish()
    if not variables.domains:
        raise root.mistake("has no variables", "expected <variables> with <var> or <array>")
    ids = _names(variables)
    symbols = {symbol: number for number, symbol in enumerate(variables.symbols)}
    domains = {name: domain_of(values, symbols, f"d_{ids[name]}") for name, values in variables.domains.items()}
    if sum(map(len, domains.values())) > 10 * MAX_VALUES:
        raise MistakeError(f"the domains have more than {10 * MAX_VALUES:,} values together", "use smaller domains")
    posting = Posting(variables, {name: tuple(domain) for name, domain in domains.items()}, symbols, ids)
    constraints = root.child("constraints")
    if constraints is not None:
        _ConstraintReader(posting).read(constraints)
    objectives = root.child("objectives")
    maximize = False
    if objectives is not None:
        with objectives.guard():
            if root.attribute("type") != "COP":
                raise MistakeError('<objectives> in an instance of type="CSP"', 'write type="COP"')
            maximize = post_objective(objectives, posting)
    root.ignore("annotations")
    root.report.finish()
    team_variables = {name: Variable(ids[name], domains[name]) for name in variables.domains}
    robots = _robots(team_variables, options.owner, path)
    _add_auxiliaries(robots, posting)
    team = assemble(
        _team_name(path, options),
        robots,
        [*posting.constraints, *posting.costs],
        kind=ProblemKind.DISWCSP if root.attribute("type") == "COP" else ProblemKind.DISCSP,
        costs=CostUnits(maximize, 0, posting.constant),
    )
    changed = {ours: theirs for theirs, ours in ids.items() if ours != theirs}
    notes = list(_notes(posting, root, changed))
    if options.infinity is not None:
        notes.append(ConversionNote("infinity", "--infinity has no effect: XCSP3 has hard constraints"))
    return ImportResult(team, NAME, changed, tuple(notes))


@dataclass
class _ConstraintReader:
    """Reads constraints, in blocks, groups and slides."""

    posting: Posting
    _extensions: tables.Extensions = field(default_factory=tables.Extensions)

    def read(self, parent: ElementView) -> None:
        """Read all constraints in `parent`."""
        ignore_remarks(parent)
        for child in parent.children("block", "group", "slide", "extension", *KINDS):
            with child.guard():
                match child.tag:
                    case "block":
                        self.read(child)
                    case "group":
                        self._group(child)
                    case "slide":
                        self._slide(child)
                    case _:
                        self._post(Element(child, self.posting.variables))

    def _group(self, group: ElementView) -> None:
        arguments = group.children("args")
        template = self._template(group)
        if not arguments:
            raise MistakeError("<group> has no <args>", "write <args> with the arguments of each constraint")
        for one in arguments:
            words = list(self.posting.variables.expand(one.text()))
            self._post(template.with_arguments(words))

    def _slide(self, slide: ElementView) -> None:
        template = self._template(slide)
        for words in slide_scopes(slide, self.posting.variables, template.arity):
            self._post(template.with_arguments(words))

    def _template(self, parent: ElementView) -> Element:
        ignore_remarks(parent)
        return Element(parent.one_of("extension", *KINDS), self.posting.variables, [])

    def _post(self, element: Element) -> None:
        ignore_remarks(element.view)
        kind = element.kind
        self.posting.line = element.view.line
        self.posting.title = element.attribute("id") or kind
        before = len(self.posting.constraints)
        (self._extensions if kind == "extension" else KINDS[kind])(element, self.posting)
        if kind not in _SYMBOLIC and self.posting.symbols:
            self._refuse_symbols(kind, before)

    def _refuse_symbols(self, kind: str, before: int) -> None:
        for constraint in self.posting.constraints[before:]:
            for name in constraint.variables:
                if self.posting.is_symbolic(name):
                    raise MistakeError(f"<{kind}> over symbols is not supported", "write it as a table")


def _names(variables: Variables) -> dict[str, str]:
    """Return the name in the team of each variable: `x_1_2` for `x[1][2]`, unless another variable has this name."""
    names = NameMap()
    plain = {name: names.allowed(name) for name in variables.domains if "[" not in name}
    for name in variables.domains:
        if "[" in name:
            pretty = re.sub(r"[\[\]]+", "_", name).strip("_")
            plain[name] = names.allowed(pretty if pretty not in variables.domains else name)
    found = {name: plain[name] for name in variables.domains}
    if len(set(found.values())) < len(found):  # `a_1[2]` and `a[1][2]`
        exact = NameMap()
        return {name: exact.allowed(name) for name in variables.domains}
    return found


def _robots(team_variables: Mapping[str, Variable], owner: str | None, path: Path) -> dict[str, list[Variable]]:
    """Return the variables of each robot, by its name."""
    try:
        pattern = re.compile(owner) if owner is not None else None
    except re.error as error:
        raise invalid_input(
            path, f"--owner {owner} is not a valid regular expression: {error}", "correct it: x\\[(\\d+)\\]"
        ) from None
    names = NameMap()
    robots: dict[str, list[Variable]] = {}
    for original, variable in team_variables.items():
        match = pattern.search(original) if pattern else None
        if pattern and not match:
            what = f"--owner {owner} does not match the variable '{original}'"
            raise invalid_input(path, what, "use a regular expression that matches the name of every variable")
        word = variable.name if match is None else match[1] if match.re.groups and match[1] else match[0]
        robots.setdefault(names.allowed(word if word[:1].isalpha() else f"r{word}"), []).append(variable)
    return robots


def _add_auxiliaries(robots: dict[str, list[Variable]], posting: Posting) -> None:
    """Add auxiliary variables to the robots named by `same_robot_as`; others get their own robots."""
    owner = {variable.name: robot for robot, variables in robots.items() for variable in variables}
    for name, (values, _, same_robot_as) in posting.auxiliaries.items():
        domain = Domain(f"d_{name}", tuple(range(value, value + 1) for value in values))
        if same_robot_as is not None:
            robots[owner[same_robot_as]].append(Variable(name, domain))
            continue
        robot = name
        while robot in robots:
            robot += "_"
        robots[robot] = [Variable(name, domain)]


def _team_name(path: Path, options: ImportOptions) -> str:
    return options.name or path.name.removesuffix(".xml")


def _notes(posting: Posting, root: ElementView, changed: Mapping[str, str]) -> list[ConversionNote]:
    notes = [ConversionNote("renamed", f"{original} is {name}") for name, original in changed.items()]
    by_purpose: dict[str, list[str]] = {}
    for name, auxiliary in posting.auxiliaries.items():
        by_purpose.setdefault(auxiliary.purpose, []).append(name)
    for purpose, added in by_purpose.items():
        if len(added) == 1:
            notes.append(ConversionNote("auxiliary", f"{added[0]} is an additional variable: {purpose}"))
        else:
            span = f"{added[0]} to {added[-1]}"
            notes.append(
                ConversionNote("auxiliary", f"{span} are {len(added)} additional variables: each is {purpose}")
            )
    if root.has("annotations"):
        notes.append(ConversionNote("annotations", "annotations for solvers are left out"))
    wide = [one for one in posting.constraints if posting.size(one.variables) > _WIDE]
    notes += [
        ConversionNote(
            "wide",
            f"line {one.line}: {one.name} is over {len(one.variables)} variables with"
            f" {readable_number(posting.size(one.variables))} combinations of values, too many for table protocols",
        )
        for one in wide[:100]
    ]
    return notes
