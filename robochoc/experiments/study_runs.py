"""The table `[runs]` in a study: protocols with their options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgspec

from robochoc.communication.simulator.channel import CHANNELS, ChannelModel, read_channel
from robochoc.experiments.digests import digest_of_protocol
from robochoc.experiments.study_file import MAX_INTEGER, Place
from robochoc.experiments.task import GIVEN, Limits, Setup, options_of
from robochoc.formats.diagnostics import shortened, suggestion
from robochoc.model.orders import Order
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.compatibility.setting_rules import refuse_settings
from robochoc.run.defaults import AUTO, CENTRAL
from robochoc.run.options import AnswerRule, Preprocess, Runtime, ScheduleName, Withdrawal
from robochoc.run.registry import UnknownProtocolError, installed_spelling, protocol_named
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionError

RUN_KEYS = (
    "protocol", "label", "settings", "order", "runtime", "channel", "seed", "schedule", "delay", "withdraw",
    "preprocess", "answer", "cold", "repair", "verify", "objectives", "timeout", "messages", "ncccs", "cycles",
)  # fmt: skip
_CHOICES: Mapping[str, Sequence[str]] = {
    "runtime": tuple(map(str, Runtime)),
    "schedule": tuple(map(str, ScheduleName)),
    "withdraw": tuple(map(str, Withdrawal)),
    "preprocess": tuple(map(str, Preprocess)),
    "answer": tuple(map(str, AnswerRule)),
    "order": tuple(dict.fromkeys((GIVEN, *map(str, Order)))),
}
MOST_SETUPS = 2000
"""The maximum number of ways to run in a table."""
_LABELLED = (
    "order", "runtime", "channel", "schedule", "delay", "withdraw", "preprocess", "answer", "cold", "repair", "verify",
    "objectives",
)  # fmt: skip
"""The options that a label may contain, in addition to the protocol and its settings."""
_OWN_LIMITS = ("timeout", "messages", "ncccs", "cycles")
_WITHIN = ("label", "settings", "seed", *_OWN_LIMITS)
"""Keys whose values are not combined by `_setups`."""


def setups_of(
    table: Mapping[str, Any], limits: Limits, place: Place
) -> Iterator[tuple[Setup, tuple[int, ...], Limits]]:
    """Yield the setups in a table, each with its seeds and limits.

    Args:
        table: The table.
        limits: The limits for the whole study.
        place: The place of the table in the file.

    Raises:
        InvalidInputError: if the table is invalid.
    """
    place.check_keys(table, RUN_KEYS)
    if "protocol" not in table:
        raise place.mistake("", "protocol is missing", 'write, for example, protocol = ["abt", "afc-ng"]')
    seeds = tuple(place.values("seed", table.get("seed", 0)))
    if not all(type(seed) is int and seed >= 0 for seed in seeds):
        raise place.mistake("seed", "expected integers of 0 or more")
    own = _own_limits(table, place)
    found = list(_setups(table, own, place))
    for setup in _labelled(found, table.get("label"), place):
        yield setup, seeds, msgspec.structs.replace(limits, **own).applicable_to(setup)


def _setups(table: Mapping[str, Any], limits: Mapping[str, Any], place: Place) -> Iterator[Setup]:
    settings = table.get("settings", {})
    at = place.below(f"{place.table}.settings")
    if not isinstance(settings, dict):
        raise place.mistake("settings", 'expected a table, such as { variant = ["A", "B"] }')
    combined = list(at.combinations(settings))
    plain_ones = list(place.combinations({key: value for key, value in table.items() if key not in _WITHIN}))
    if (count := len(combined) * len(plain_ones)) > MOST_SETUPS:
        raise place.mistake("", f"describes {count:,} ways to run; at most {MOST_SETUPS:,} are allowed")
    for plain in plain_ones:
        for one in combined:
            setup = _setup(plain, {name: _text(value) for name, value in one.items()}, place)
            _refuse(setup, Limits(**limits), place)
            by_robots = setup.protocol not in {CENTRAL, AUTO}
            source = digest_of_protocol(protocol_named(setup.protocol)) if by_robots else ""
            yield msgspec.structs.replace(setup, source=source)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _setup(plain: Mapping[str, Any], settings: dict[str, str], place: Place) -> Setup:
    given = dict(plain)
    for key, choices in _CHOICES.items():
        if key in given and given[key] not in choices:
            hint = suggestion(str(given[key]), choices, "names")
            raise place.mistake(key, f"expected {', '.join(choices)}, got {shortened(str(given[key]))}", hint)
    if given.get("order") == GIVEN:
        del given["order"]
    given["protocol"] = installed_spelling(str(given["protocol"]))
    if "channel" in given:
        given["channel"] = _channel(given["channel"], place)
    try:
        setup = msgspec.convert({**given, "settings": settings}, Setup)
    except msgspec.ValidationError as wrong:
        raise place.mistake("", str(wrong)) from None
    if setup.delay < 0:
        raise place.mistake("delay", f"expected 0 or more, got {setup.delay}")
    return setup


def _channel(word: object, place: Place) -> ChannelModel:
    if isinstance(word, str) and word in CHANNELS:
        return CHANNELS[word]
    return read_channel(place.path.parent / str(word))


def _refuse(setup: Setup, limits: Limits, place: Place) -> None:
    """Raise `InvalidInputError` if the options in `setup` cannot be combined for any problem."""
    try:
        refuse_options(options_of(setup, limits))
        if setup.protocol not in {CENTRAL, AUTO}:
            refuse_settings(setup.protocol, protocol_named(setup.protocol), setup.settings)
    except UnknownProtocolError as unknown:
        raise place.mistake("protocol", str(unknown), "robochoc protocols lists them") from None
    except (OptionError, UnsupportedError) as refused:
        raise place.mistake("", str(refused)) from None


def _own_limits(table: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Return the limits in a table `[runs]`."""
    own = {name: table[name] for name in _OWN_LIMITS if name in table}
    for name, value in own.items():
        kinds = (int, float) if name == "timeout" else (int,)
        if type(value) not in kinds or not 0 < value <= MAX_INTEGER:
            raise place.mistake(name, f"expected more than 0, got {shortened(str(value))}")
    return own


def _labelled(setups: Sequence[Setup], label: object, place: Place) -> Iterator[Setup]:
    """Yield the setups of a table, each with a label that shows how it differs from the others."""
    if label is not None and (not isinstance(label, str) or len(setups) > 1 or not label.isprintable()):
        raise place.mistake("label", "expected one line of text, in a table with one way to run")
    for one in setups:
        yield msgspec.structs.replace(one, label=label or " ".join([one.protocol, *_differences(one, setups)]))


def distinct(given: Sequence[tuple[Setup, Limits]]) -> list[Setup]:
    """Return the setups of all tables. Different setups with the same label are given longer labels.

    Args:
        given: The setups with their limits, which may also differ.
    """
    found: list[Setup] = []
    alike: dict[str, list[tuple[Setup, Limits]]] = {}
    for setup, limits in given:
        alike.setdefault(setup.label, []).append((setup, limits))
    for setup, limits in given:
        same = alike[setup.label]
        words = _differences(setup, [other for other, _ in same])
        if len({other.protocol for other, _ in same}) > 1:
            words.insert(0, setup.protocol)
        for name in _OWN_LIMITS:
            several = len({getattr(other, name) for _, other in same}) > 1
            if several and getattr(limits, name) is not None:
                words.append(f"{name}={getattr(limits, name)}")
        found.append(msgspec.structs.replace(setup, label=" ".join([setup.label, *words])))
    return found


def _differences(one: Setup, others: Sequence[Setup]) -> list[str]:
    """Return words that describe how a setup differs from others."""
    settings = sorted({name for other in others for name in other.settings})
    differing = [name for name in settings if len({other.settings.get(name) for other in others}) > 1]
    names = [name for name in _LABELLED if any(getattr(other, name) != getattr(one, name) for other in others)]
    words = [f"{name}={one.settings[name]}" for name in differing if name in one.settings]
    return [word for word in [*words, *(_label_word(name, getattr(one, name)) for name in names)] if word]


def _label_word(name: str, value: object) -> str:
    if isinstance(value, ChannelModel):
        return value.name
    if name in {"delay", "cold", "repair", "verify"}:
        return f"{name}={_text(value)}" if value else ""
    return str(value) if value is not None else GIVEN if name == "order" else ""
