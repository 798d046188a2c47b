"""All errors of a sketch, and hints on problems."""

from __future__ import annotations

from robochoc.app.sketch import chances, fits, shape
from robochoc.app.sketch.fits import Facts
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.troubles import Trouble


def troubles(sketch: Sketch) -> list[Trouble]:
    """Return the errors of a sketch, followed by hints. Without errors, `building.model_of` returns its model.

    Hints are on probable mistakes: rules that can never be satisfied, or too many combinations.
    """
    found, facts = _checked(sketch)
    if facts and not any(trouble.is_error for trouble in found):
        found += [*chances.hopeless(facts), *chances.large(facts)]
    return sorted(found, key=lambda trouble: not trouble.is_error)


def errors_of(sketch: Sketch) -> list[Trouble]:
    """Return the errors of a sketch. This is faster than `troubles`, since hints are slow."""
    return [trouble for trouble in _checked(sketch)[0] if trouble.is_error]


def _checked(sketch: Sketch) -> tuple[list[Trouble], Facts | None]:
    """Return all errors and quick hints, and the facts about a sketch that is within bounds."""
    found = [*shape.of_bounds(sketch)]
    if found:
        return found, None
    found += [*shape.of_names(sketch), *shape.of_robots(sketch), *shape.of_decisions(sketch)]
    facts = Facts(sketch)
    return [*found, *facts.unfit.values(), *fits.of_secrets(facts), *fits.of_number(facts)], facts
