"""The families by name make what the commands of `robochoc generate` make."""

from __future__ import annotations

import click

from robochoc.cli.commands.generate import generate
from robochoc.generators.families import FAMILIES, parameters_of, required_of
from tests.support.cases import cases
from tests.support.program import ROOT

OF_THE_COMMAND = {"output", "force", "help"}
BUILDING = str(ROOT / "docs/examples/building/building.yaml")
EXAMPLES: dict[str, dict[str, int | float | str]] = {
    "agentsnet": {"task": "matching", "agents": 4, "degree": 2.0},
    "coloring": {"agents": 5, "degree": 2.0},
    "coverage": {"map": BUILDING, "agents": 2, "cells": 20},
    "formation": {"map": BUILDING, "agents": 2},
    "frequencies": {"agents": 4, "frequencies": 3},
    "grid-sensors": {"rows": 2, "columns": 2, "targets": 1},
    "heights": {"agents": 3},
    "ising": {"rows": 2, "columns": 2},
    "meetings": {"agents": 3, "meetings": 2, "slots": 3},
    "nary": {"agents": 4, "domain": 2, "constraints": 3},
    "patrol": {"map": BUILDING, "agents": 2},
    "queens3d": {"n": 2},
    "random": {"agents": 4, "domain": 2, "density": 0.5, "tightness": 0.5},
    "sensors": {"sensors": 4, "targets": 1},
    "smart-grid": {"agents": 2},
    "smart-homes": {"agents": 3, "rules": 2},
    "stochastic": {"agents": 3, "domain": 2},
    "swarm": {"agents": 2},
    "swarm-on-map": {"map": BUILDING, "agents": 2},
    "tasks": {"agents": 2, "tasks": 2},
    "tracking": {"agents": 2, "targets": 1, "side": 3},
}


def test_parameters_are_the_options_of_the_command() -> None:
    with cases() as each:
        for family in FAMILIES:
            with each(family):
                command = generate.commands[family]
                options = {option.name: option for option in command.params if isinstance(option, click.Option)}
                assert set(parameters_of(family)) == set(options) - OF_THE_COMMAND
                made = FAMILIES[family](**EXAMPLES[family])
                same = {
                    name: option.default
                    for name, option in options.items()
                    if name not in {*OF_THE_COMMAND, *EXAMPLES[family]} and option.default is not None
                }
                plain = {name: value for name, value in same.items() if isinstance(value, (int, float, str))}
                assert FAMILIES[family](**EXAMPLES[family], **plain) == made
                assert set(required_of(family)) <= set(EXAMPLES[family])


def test_every_family_is_a_command() -> None:
    assert {*FAMILIES, "scenario"} == set(generate.commands) == {*EXAMPLES, "scenario"}
