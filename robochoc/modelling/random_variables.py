"""Random variables of a model: terms whose values are drawn by chance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.names import is_name
from robochoc.formats.random_variables import check_random
from robochoc.model.random_variable import RandomVariable
from robochoc.model.uncertainty import Outcomes
from robochoc.modelling.codes import Symbols, codes_of
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine
from robochoc.modelling.numbers import exact, is_truth, places_of, whole_number
from robochoc.modelling.terms import ModelVariable

BY_CHANCE = ""
"""The owner of random variables: no robot."""


def random_variable(
    name: str,
    distribution: object,
    seen_by: Iterable[ModelVariable],
    known: Mapping[str, ModelVariable],
    place: SourceLine,
) -> tuple[ModelVariable, RandomVariable]:
    """Return the term and the data of a random variable. See `Model.random`.

    Args:
        name: The name.
        distribution: The probability of each outcome.
        seen_by: The variables whose values are chosen after the outcome was observed.
        known: The variables of the model.
        place: The line that creates the random variable.

    Raises:
        ModelError: if an argument is invalid.
    """
    if not is_name(name) or name in known:
        used = f"exists already, created at {known[name].place}" if name in known else "is not a valid name"
        raise ModelError(f"variable {name!r} {used}", "use another name: a letter, then letters, digits, '.' and '_'")
    if not isinstance(distribution, Mapping):
        raise ModelTypeError(f"invalid distribution {distribution!r}", "expected a dictionary: {0: 0.7, 3: 0.3}")
    chances = {_outcome(value): Fraction(exact(chance)) for value, chance in distribution.items()}
    try:
        places = max((places_of(one, place) for one in chances.values()), default=0)
    except ModelError:
        hint = "use decimals of at most nine places with the sum 1: {0: 0.333, 1: 0.333, 2: 0.334}"
        raise ModelError("a probability is not an exact decimal", hint, place) from None
    weights = tuple(int(one * 10**places) for one in chances.values())
    if isinstance(seen_by, (str, ModelVariable)) or not isinstance(seen_by, Iterable):
        raise ModelTypeError(f"invalid seen_by {seen_by!r}", "list variables: [relay]", place)
    observers = tuple(seen_by)
    for one in observers:
        if known.get(getattr(one, "name", "")) is not one or one.owner == BY_CHANCE:
            raise ModelError(f"{one!r} in seen_by is not a variable of a robot of this model", "list variables", place)
    made = RandomVariable(name, tuple(chances), weights, places, tuple(one.name for one in observers))
    try:
        check_random(made, (), ())
    except MistakeError as mistake:
        raise ModelError(mistake.message, mistake.hint, place) from None
    codes = codes_of(sorted(made.outcomes), Symbols(), place)
    return ModelVariable(name, codes, BY_CHANCE, place), made


def with_decisions(
    variables: Mapping[str, ModelVariable], random: Iterable[RandomVariable]
) -> dict[str, ModelVariable]:
    """Return `variables`, and each variable also under the names of the values in its policy."""
    outcomes = Outcomes(random)
    found = dict(variables)
    for name, variable in variables.items():
        if variable.owner != BY_CHANCE:
            found |= dict.fromkeys(outcomes.decisions(name), variable)
    return found


def _outcome(value: object) -> int:
    whole = None if is_truth(value) else whole_number(value)
    if whole is None:
        raise ModelTypeError(f"the outcome {value!r} is not an integer", "use integers, and tables for other values")
    return whole
