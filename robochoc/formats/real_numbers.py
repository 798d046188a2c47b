"""Real domains, the precision of real numbers, and the places of functions over them.

docs/reference/format.md, "Real numbers".
"""

from __future__ import annotations

import re

from lxml import etree

from robochoc.formats.costs import places_of_scale, scale_text
from robochoc.formats.definitions import check_domain
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import check_integer
from robochoc.formats.xml import attribute
from robochoc.model.cost_units import MAX_PLACES
from robochoc.model.expression import Expression, Type
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.problem import CostUnits, Domain, Function, Predicate
from robochoc.model.real import (
    DEFAULT_PLACES,
    DEFAULT_POINTS,
    MOST_PLACES,
    MOST_POINTS,
    RealInterval,
    RealParameters,
    grid,
)

REAL_KINDS = ("real", "steps")
"""The types of real parameters: in the user's unit, or as the number of steps of the precision."""

_DECIMAL = r"[+-]?[0-9]{1,12}(?:\.[0-9]{1,9})?"
_INTERVAL = re.compile(rf"\s*({_DECIMAL})\.\.({_DECIMAL})\s*(?::(.*))?", re.DOTALL)


def read_precision(presentation: etree._Element) -> int:
    """Return the decimal places of the real numbers in a file. Raises `MistakeError`."""
    given = attribute(presentation, "precision")
    if not given:
        return DEFAULT_PLACES
    places = places_of_scale(given)
    if places is None or places > MOST_PLACES:
        hint = f"expected a power of ten of at most {MOST_PLACES} places: 1, 0.1, 0.01, ..."
        raise MistakeError(f"invalid precision '{shortened(given)}'", hint)
    return places


def read_real_domain(element: etree._Element, places: int) -> Domain:
    """Return a real domain from its interval, `0..2.5`, and the points of its grid, `0..2.5: 0 1 2`.

    Without these, the grid has evenly spaced points. Raises `MistakeError`.
    """
    name, text = attribute(element, "name"), element.text or ""
    match = _INTERVAL.fullmatch(text)
    if not match:
        message = f"'{shortened(text.strip())}' is not an interval of real numbers"
        raise MistakeError(message, "write one interval of decimals: 0..2.5")
    low, high = (_steps(word, places) for word in match.groups()[:2])
    if low >= high:
        raise MistakeError(f"the interval {match[1]}..{match[2]} is empty", "write the smaller number first: 0..2.5")
    real, given = RealInterval(low, high, places), element.get("points")
    if match[3] is not None:
        if given is not None:
            raise MistakeError("the domain has points and a list of points", "use one of them")
        values = sorted(read_steps(word, real) for word in match[3].split())
        ranges = tuple(range(value, value + 1) for value in values)
    else:
        points = int(given or DEFAULT_POINTS)
        if not 1 < points <= MOST_POINTS:
            raise MistakeError(f"points is {points}", f"use 2 to {MOST_POINTS} points")
        ranges = grid(low, high, points)
    domain = Domain(name, ranges, real=real)
    check_domain(domain)
    check_real_domain(domain, real)
    return domain


def real_domain_text(domain: Domain, real: RealInterval) -> str:
    """Return the text of a real domain, for `read_real_domain`."""
    interval = f"{_decimal_text(real.low, real.places)}..{_decimal_text(real.high, real.places)}"
    if domain.ranges == Domain("", grid(real.low, real.high, DEFAULT_POINTS)).ranges:
        return interval
    return f"{interval}: {' '.join(_decimal_text(value, real.places) for value in domain)}"


def source_of(definition: Predicate | Function, real: RealParameters) -> Expression | None:
    """Return the expression over real numbers from which the body was made; None if the body has another origin."""
    wanted = Type.BOOLEAN if isinstance(definition, Predicate) else Type.INTEGER
    places = 0 if isinstance(definition, Predicate) else definition.places
    if real.source is None or fixed_point(real.source, real.names, real.places, wanted, places) != definition.body:
        return None
    return real.source


def read_value_places(function: etree._Element) -> int:
    """Return the decimal places of a function's value. Raises `MistakeError`."""
    given = attribute(function, "scale")
    words = (function.findtext("parameters") or "").split()
    if not given:
        return VALUE_PLACES if "real" in words[::2] else 0
    places = places_of_scale(given)
    most = VALUE_PLACES if "real" in words[::2] else MAX_PLACES
    if places is None or places > most:
        hint = f"expected a power of ten of at most {most} places: 1, 0.1, 0.01, ..."
        raise MistakeError(f"invalid scale '{shortened(given)}'", hint)
    return places


def check_function_places(function: Function, units: CostUnits) -> None:
    """Raise `MistakeError` if the value of a function has more decimal places than the costs of its robot."""
    if function.places > units.places:
        message = f"the value of {shortened(function.name)} has {function.places} decimal places, costs {units.places}"
        hint = f'write scale="{scale_text(function.places)}" in the presentation, or leave the scale out'
        raise MistakeError(message, hint)


def check_real_domain(domain: Domain, real: RealInterval) -> None:
    """Raise `MistakeError` unless the values of a domain are in its interval `real`."""
    name = shortened(domain.name)
    if domain.symbols:
        raise MistakeError(f"domain {name} has symbols and an interval", "use one of them")
    if not 0 <= real.places <= MOST_PLACES:
        raise MistakeError(f"domain {name} has {real.places} decimal places", f"use 0 to {MOST_PLACES}")
    for end in (real.low, real.high):
        check_integer(end)
    if real.low >= real.high:
        raise MistakeError(f"the interval of domain {name} is empty", "give the smaller number first")
    for part in domain.ranges:
        if part[0] < real.low or part[-1] > real.high:
            wrong = part[0] if part[0] < real.low else part[-1]
            message = f"the value {real.number(wrong)} of domain {name} is outside its interval"
            raise MistakeError(message, "use values in the interval")


def read_steps(word: str, real: RealInterval) -> int:
    """Return a number, in the text of a file, in steps of the precision of `real`. Raises `MistakeError`."""
    if not re.fullmatch(_DECIMAL, word):
        raise MistakeError(f"'{shortened(word)}' is not a real number", "write a decimal: 2.5")
    return _steps(word, real.places)


def _steps(word: str, places: int) -> int:
    from fractions import Fraction  # noqa: PLC0415 - start-up: rarely needed

    exact = Fraction(word) * 10**places
    if exact.denominator != 1:
        hint = f'round it, or write precision="{scale_text(len(word.partition(".")[2]))}" in the presentation'
        raise MistakeError(f"{word} has more decimal places than the precision {scale_text(places)}", hint)
    return int(exact)


def _decimal_text(steps: int, places: int) -> str:
    whole, rest = divmod(abs(steps), 10**places)
    decimals = str(rest).rjust(places, "0").rstrip("0") if places else ""
    return f"{'-' * (steps < 0)}{whole}{'.' * bool(decimals)}{decimals}"
