"""`--help`: short enough to be read, each option in one section, names of protocols in any case."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from robochoc import load
from robochoc.cli.commands.capacity import DEADLINE_MIN_S
from robochoc.cli.commands.play import MOST_ROUNDS
from robochoc.cli.group import COMMANDS, cli
from robochoc.cli.options.sections import COMMON, REST, SectionedCommand
from robochoc.cli.options.value_types import LARGEST_SEED, MOST
from robochoc.experiments.capacity import measurement
from robochoc.protocols import settings
from robochoc.run.compatibility import option_rules
from robochoc.run.registry import installed_spelling
from robochoc.seats import game
from tests.support.cases import cases
from tests.support.program import robochoc_within

MANY = 12
"""A command with more options has sections."""


def commands(group: click.Group, *path: str) -> Iterator[tuple[str, click.Command]]:
    """Yield every command with its words, also those of groups."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, *path, name)
        yield " ".join((*path, name)), command


@pytest.fixture(scope="module", name="every")
def every_command() -> dict[str, click.Command]:
    return dict(commands(cli))


def options_of(command: click.Command) -> list[click.Option]:
    return [one for one in command.get_params(click.Context(command)) if isinstance(one, click.Option)]


def test_every_command_has_help_without_an_option_that_is_not_explained(every: dict[str, click.Command]) -> None:
    with cases() as each:
        for name, command in every.items():
            with each(name):
                done = CliRunner().invoke(cli, [*name.split(), "--help"])
                assert done.exit_code == 0
                assert REST not in done.stdout
                assert "=None" not in done.stdout
                assert [one.opts for one in options_of(command) if not one.help] == []


def test_every_option_is_in_one_section_where_there_are_many(every: dict[str, click.Command]) -> None:
    sectioned = {name: command for name, command in every.items() if isinstance(command, SectionedCommand)}
    assert {name for name, command in every.items() if len(options_of(command)) > MANY} <= {*sectioned}
    with cases() as each:
        for name, command in sectioned.items():
            with each(name):
                named = Counter(spelling for spellings in command.sections.values() for spelling in spellings)
                there = options_of(command)
                spelt = {spelling for one in there for spelling in one.opts}
                assert set(named) <= spelt | {"--help"}
                assert [one.opts for one in there if sum(named[spelling] for spelling in one.opts) != 1] == []
                assert next(iter(command.sections)) == COMMON


def test_help_on_solve_shows_what_most_runs_need_on_the_first_screen() -> None:
    lines = robochoc_within("solve", "--help").stdout.splitlines()
    assert len(lines) < 100
    screen = "\n".join(lines[:40])
    for option in ("--protocol", "--runtime", "--timeout", "--withdraw", "--json", "--html", "--journal", "--sniff"):
        assert f"\n  {option}" in screen


def test_help_on_robochoc_names_every_command() -> None:
    words = robochoc_within("--help").stdout
    assert all(f"\n  {name} " in words for name in COMMANDS)


def test_a_protocol_is_known_in_any_case(four: Path) -> None:
    for typed, name in [("ABT", "abt"), ("AFC-ng", "afc-ng"), ("Central", "central")]:
        assert installed_spelling(typed) == name
        done = robochoc_within("solve", four, "--runtime", "simulator", "--protocol", typed)
        assert (done.returncode, name in done.stdout) == (0, True)
    assert installed_spelling("?") == "?"
    assert load(four).solve("DisFC", "simulator").protocol == "disfc"


def test_the_minimum_withdrawal_has_its_former_name_too(four: Path) -> None:
    for option in ("--withdraw=minimum", "--withdraw=fewest", "--withdraw"):
        assert robochoc_within("solve", four, "--runtime", "simulator", option).returncode == 0


def test_every_number_option_rejects_other_words_in_the_same_way(every: dict[str, click.Command]) -> None:
    numbers = [
        (f"robochoc {name}", option)
        for name, command in every.items()
        for option in options_of(command)
        if isinstance(option.type, click.types.IntParamType | click.types.FloatParamType)
    ]
    assert len(numbers) > 100
    for name, option in numbers:
        for word in ("nan", "five", ""):
            with pytest.raises(click.BadParameter) as refused:
                option.type.convert(word, option, None)
            kinds = r"(a|a finite|a whole) number( of at least .+| greater than .+| from .+ to .+)?"
            assert re.fullmatch(f"'{word}' is not {kinds}", refused.value.message), (name, option.name)


def test_every_whole_number_has_a_maximum(every: dict[str, click.Command]) -> None:
    for name, command in every.items():
        for parameter in command.params:
            assert parameter.type is not click.INT, (name, parameter.name)
            if isinstance(parameter.type, click.IntRange):
                assert parameter.type.max is not None, (name, parameter.name)


def test_limits_that_commands_repeat() -> None:
    limits = (settings.MOST, option_rules.LARGEST_SEED, game.MOST_ROUNDS, measurement.DEADLINE_MIN_S)
    assert limits == (MOST, LARGEST_SEED, MOST_ROUNDS, DEADLINE_MIN_S)
