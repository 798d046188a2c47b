"""Small elements that several pages share, and validation of numbers in fields."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from typing import Any, Protocol

from nicegui import ui
from nicegui.element import Element
from nicegui.elements.mixins.validation_element import ValidationElement

from robochoc.app.sketch.troubles import Trouble
from robochoc.app.texts import say


def bounded_integer(value: object, least: int, most: int, otherwise: int) -> int:
    """Return the integer in a field, clamped to [least, most].

    Args:
        value: The value of the field.
        least: The minimum.
        most: The maximum.
        otherwise: The result if the value is not a number.
    """
    if not isinstance(value, (int, float)) or not isfinite(value):
        return otherwise
    return min(max(int(value), least), most)


class Card(Protocol):
    """An entry in a list that shows part of the sketch."""

    element: Element

    def follow(self) -> None:
        """Update the card to the current sketch."""


class Cards:
    """A list of cards, one for each key. Cards are reused when the sketch changes, so typed text is not lost."""

    def __init__(self, container: Element, make: Callable[..., Card]) -> None:
        self._container, self._make = container, make
        self._cards: dict[Hashable, Card] = {}

    def follow(self, keys: Sequence[Hashable]) -> None:
        """Show a card for each key, in order."""
        for key in [key for key in self._cards if key not in set(keys)]:
            self._cards.pop(key).element.delete()
        for place, key in enumerate(keys):
            if key not in self._cards:
                with self._container:
                    self._cards[key] = self._make(key)
                if place != len(self._cards) - 1:
                    self._cards[key].element.move(target_index=place)
        for card in [*self._cards.values()]:
            card.follow()


class TroubleLines:
    """Lines with the errors and hints for the element above them, and the remedies."""

    def __init__(self) -> None:
        self._box = ui.element("div").classes("troubles").props("role=status")
        self._shown: list[Trouble] = []

    def show(self, troubles: list[Trouble]) -> None:
        """Show only these errors and hints."""
        if troubles == self._shown:
            return
        self._shown = troubles
        self._box.clear()
        with self._box:
            for trouble in troubles:
                with ui.element("p").classes("trouble" if trouble.is_error else "trouble hint"):
                    ui.icon("error_outline" if trouble.is_error else "lightbulb").props("aria-hidden=true")
                    with ui.element("span"):
                        line(trouble.text)
                        line(trouble.remedy, "soft")


def line(text: str, classes: str = "") -> ui.label:
    """Add a line with a text."""
    return ui.label(text).classes(f"run {classes}")


@contextmanager
def panel(key: str) -> Iterator[Element]:
    """Add a panel with a heading."""
    with ui.element("section").classes("panel part").props(f'aria-label="{say(key)}"') as section:
        with ui.element("h2"):
            ui.label(say(key))
        yield section


def icon_button(icon: str, says: str, does: Callable[[], object]) -> ui.button:
    """Add a button with only an icon. `says` is its name for screen readers, and its tooltip."""
    button = ui.button(icon=icon, on_click=does).props("flat round dense size=sm").classes("quiet")
    name_it(button, says)
    return button


def name_it(element: Element, says: str) -> None:
    """Set an element's tooltip and its name for screen readers, which may contain any characters."""
    if element.props.get("aria-label") != says:
        element.props["aria-label"] = says
        element.props["title"] = says
        element.update()


def number_field(key: str, least: int, most: int, changed: Callable[[int], str | None]) -> ui.number:
    """Add a field for an integer. `changed` performs the edit, and returns the text of an error."""

    def check(value: float | None) -> str | None:
        if value is None or not least <= value <= most or value != int(value):  # NaN is within no limits
            return say("model.number", least=least, most=most)
        return changed(int(value))

    field = ui.number(say(key), min=least, max=most, precision=0, validation=check)
    return field.props("dense outlined debounce=300").classes("number")


def everybody_button(does: Callable[[], object]) -> ui.button:
    """Add the button that makes an element apply to all robots again."""
    return (
        ui.button(say("model.everybody"), icon="groups", on_click=does)
        .props("flat dense no-caps align=left")
        .classes("wide")
    )


def refuse_last(choice: ui.select, robots: Sequence[str], why: str) -> None:
    """Restore the last robot in a selection and show the reason: an empty selection would mean all robots."""
    choice.set_value([*robots])
    choice.error = why


def put(field: ValidationElement[Any], value: object) -> None:
    """Show a value in a field, unless the user is typing text that is not valid yet."""
    if field.value != value and not field.error:
        field.set_value(value)
