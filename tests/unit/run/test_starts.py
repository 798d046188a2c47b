"""The start of a search in the user's words: `solve(start=...)`, `--start`, and the epochs of a changing problem."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click.testing
import pytest

import robochoc
from robochoc import Model, Solution, solve
from robochoc.cli.main import main
from robochoc.journal.events import AnyEvent, Began, Decided
from robochoc.model.outcome import Verdict
from robochoc.run import Options, Runtime
from robochoc.run.starts import Start, start_in, start_of_outcome
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionError, OptionTypeError
