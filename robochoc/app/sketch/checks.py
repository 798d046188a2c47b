"""All that is wrong with a sketch."""

from __future__ import annotations

from robochoc.app.sketch import chances, fits, shape
from robochoc.app.sketch.fits import Facts
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.troubles import Trouble


def troubles(sketch: Sketch) -> list[Trouble]:
    """Return what is wrong with a sketch, errors first. Where there is no error, `building.model_of` makes its model.

    Hints tell what is a team, but can hardly be meant: rules that can never hold, or too many combinations.
    """
    found, facts = _looked_at(sketch)
    if facts and not any(trouble.is_error for trouble in found):
        found += [*chances.hopeless(facts), *chances.large(facts)]
    return sorted(found, key=lambda trouble: not trouble.is_error)


def errors_of(sketch: Sketch) -> list[Trouble]:
    """Return what keeps a sketch from being a team, sooner than `troubles`: hints take the most time."""
    return [trouble for trouble in _looked_at(sketch)[0] if trouble.is_error]


def _looked_at(sketch: Sketch) -> tuple[list[Trouble], Facts | None]:
    """Return all errors, and the hints that are seen beside them; and the facts of a sketch that is within bounds."""
    found = [*shape.of_bounds(sketch)]
    if found:
        return found, None
    found += [*shape.of_names(sketch), *shape.of_robots(sketch), *shape.of_decisions(sketch)]
    facts = Facts(sketch)
    return [*found, *facts.unfit.values(), *fits.of_secrets(facts), *fits.of_number(facts)], facts
