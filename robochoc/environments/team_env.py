"""A PettingZoo environment for any team: each agent is a robot, and chooses one of its values in each round.

All robots choose at the same time. A robot observes what it may know: the values that its neighbours chose in the
previous round, the cost of each of its own values given these, and its neighbours' signals. See `TeamEnv`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils import parallel_to_aec

from robochoc.model.problem import Team
from robochoc.rounds.optimum import Optimum, certified_optimum
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.run.defaults import CENTRAL
from robochoc.solver.encoding import max_cost
from robochoc.system.errors import OptionError
from robochoc.system.plain_text import on_one_line

ENV_NAME = "robochoc_team_v0"
MAX_SIGNALS = 256
"""The maximum number of different signals."""

Observation = dict[str, Any]
Action = Any
"""The index of a value, or a pair of this index and a signal."""


class HasTeam(Protocol):
    """A `robochoc.Problem` or a `robochoc.Model`."""

    @property
    def team(self) -> Team:
        """The team."""


class Reward(StrEnum):
    """The reward of a robot in a round: the decrease of the costs in its own constraints, or of the team's cost."""

    OWN = "own"
    TEAM = "team"


class TeamEnv(ParallelEnv):
    """A team as a PettingZoo `ParallelEnv`.

    - **Agents**: the robots, by name.
    - **Action**: the index of a value (`values`). With `signals`, a pair: this index, and a signal to all neighbours.
    - **Observation**: a dictionary. `value`: the index of the robot's own value. `neighbours`: for each variable that a
      neighbour shows, the index in its domain of the value in the previous round. `costs` and `violations`: for each
      own value, its cost and the number of violated hard constraints, if the neighbours keep their values. `signals`:
      the signal of each neighbour, 0 in the first round. Robots without neighbours have no `neighbours` and `signals`.
    - **Reward**: the decrease of costs since the previous round; a violation costs `violation_cost`. So the sum of a
      robot's rewards is the decrease from the first to the last round.
    - **Infos**: `cost`, the cost of the whole team in the user's units (None if a hard constraint is violated);
      `violations`, their number; `regret`, by how much the cost is worse than the optimum (infinite if a hard
      constraint is violated, None if the optimum is unknown). These are for evaluation: no robot knows them.
    - **End**: all robots are truncated after `rounds` rounds.

    Args:
        problem: The team, or a problem or model with a team. It must not have a scenario.
        rounds: The number of rounds of an episode.
        reward: `own` or `team`.
        signals: The number of different signals; 0: robots send none.
        optimum: The protocol that computes the optimum (`certified_optimum`), a known optimum, or None: no regret.
        violation_cost: The cost of a violated hard constraint in rewards. None: see `TeamRounds`.
        render_mode: `ansi`: `render` returns text; `human`: it prints the text; None: it does nothing.

    Attributes:
        optimum: The optimum, and how it was certified; None if it was not requested.

    Raises:
        InvalidInputError: if the team is not valid.
        OptionError: if an argument is not allowed.
        UnsupportedError: if the team has a scenario, or a robot has no possible value.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as PettingZoo declares it
        "name": ENV_NAME,
        "render_modes": ["ansi", "human"],
        "is_parallelizable": True,
    }

    def __init__(
        self,
        problem: Team | HasTeam,
        *,
        rounds: int = 50,
        reward: str = Reward.TEAM,
        signals: int = 0,
        optimum: str | Optimum | None = CENTRAL,
        violation_cost: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        team = problem if isinstance(problem, Team) else getattr(problem, "team", None)
        if not isinstance(team, Team):
            raise OptionError(f"problem is {_shown(problem)}; use a Team, a Problem or a Model")
        _refuse_options(rounds, reward, signals, optimum, violation_cost, render_mode)
        self._state = TeamRounds(team, violation_cost)
        self._rounds, self._reward, self._signals = rounds, Reward(reward), signals
        self.render_mode = render_mode
        self.optimum = certified_optimum(team, optimum) if isinstance(optimum, str) else optimum
        self.possible_agents: list[str] = [*self._state.problems]
        self.agents: list[str] = []
        self._domains = {
            name: {value: place for place, value in enumerate(variable.domain)}
            for name, variable in self._state.team.variables.items()
        }
        most = float(sum(max_cost(constraint) for constraint in self._state.team.constraints()))
        number = sum(1 for _ in self._state.team.constraints())
        self._action_spaces = {name: self._actions_of(name) for name in self.possible_agents}
        self._observation_spaces = {name: self._observations_of(name, most, number) for name in self.possible_agents}
        self.state_space = spaces.MultiDiscrete([len(self.values(name)) for name in self.possible_agents])
        self._sent: dict[str, int] = {}
        self._random = np.random.default_rng()
        self._round = 0
        self._is_reset = False

    def values(self, agent: str) -> list[dict[str, float | str]]:
        """Return the values of a robot in the order of their indices, each by variable, in the user's notation.

        Raises:
            OptionError: if no robot is called `agent`.
        """
        self._refuse_name(agent)
        problem, variables = self._state.problems[agent], self._state.team.variables
        found = [problem.solution(index) for index in range(len(problem.values))]
        return [{name: variables[name].domain.label(part) for name, part in one.items()} for one in found]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the robot's values, or pairs of a value and a signal."""
        return self._action_spaces[agent]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of the observations of a robot."""
        return self._observation_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode, in which each robot has a random value.

        Args:
            seed: The seed of this and later episodes. None: the random numbers continue.
            options: `values` has the index of the first value of some robots, by name. Other keys are ignored.

        Raises:
            OptionError: if `values` is not a mapping from robots to indices of their values.
        """
        given = (options or {}).get("values", {})
        if not isinstance(given, Mapping):
            raise OptionError(f"values is {_shown(given)}; use a mapping from robots to the indices of values")
        for name, index in given.items():
            self._refuse_value(name, index)
        if seed is not None:
            self._random = np.random.default_rng(seed)
        self.agents = [*self.possible_agents]
        self._round, self._is_reset = 0, True
        self._sent = dict.fromkeys(self.agents, 0)
        drawn = {name: int(self._random.integers(len(self.values(name)))) for name in self.agents}
        self._state.choose(drawn | {name: int(index) for name, index in given.items()})
        return {name: self._observation(name) for name in self.agents}, self._infos()

    def step(
        self, actions: Mapping[str, Action]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let all robots choose their values at the same time. Robots without an action keep their values.

        Raises:
            OptionError: if an action is not in the robot's action space.
        """
        self._require_reset()
        if not self.agents:
            return {}, {}, {}, {}, {}
        before = self._paid()
        chosen = {name: self._parts_of(name, action) for name, action in actions.items()}
        self._state.choose({name: index for name, (index, _) in chosen.items()})
        self._sent |= {name: signal for name, (_, signal) in chosen.items()}
        after = self._paid()
        rewards = {name: before[name] - after[name] for name in self.agents}
        self._round += 1
        over = self._round >= self._rounds
        observations, infos = {name: self._observation(name) for name in self.agents}, self._infos()
        terminated, truncated = dict.fromkeys(self.agents, False), dict.fromkeys(self.agents, over)
        if over:
            self.agents = []
        return observations, rewards, terminated, truncated, infos

    def state(self) -> NDArray[np.int64]:
        """Return the index of the value of each robot, in the order of `possible_agents`. Requires `reset`."""
        self._require_reset()
        return np.array([self._state.values[name] for name in self.possible_agents], dtype=np.int64)

    def render(self) -> str | None:
        """Return or print the round, the robots' values and the cost, as text."""
        if self.render_mode is None:
            return None
        self._require_reset()
        broken, _ = self._state.team_cost
        cost = f"violated hard constraints: {broken}" if broken else f"cost {self._state.user_cost}"
        lines = [f"round {self._round} of {self._rounds}: {cost}"]
        for name in self.possible_agents:
            parts = self.values(name)[self._state.values[name]].items()
            lines.append(f"  {name}: {', '.join(f'{variable} = {part}' for variable, part in parts)}")
        text = "\n".join(lines)
        if self.render_mode == "ansi":
            return text
        print(text)  # noqa: T201 - what this mode is for
        return None

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def _require_reset(self) -> None:
        """Raise `OptionError` before the first episode."""
        if not self._is_reset:
            raise OptionError("the environment has no episode yet: call reset first")

    def _refuse_value(self, name: str, index: object) -> None:
        """Raise `OptionError` if `index` is not the index of a value of the robot called `name`."""
        self._refuse_name(name)
        number = len(self._state.problems[name].values)
        if not _is_number_in(index, 0, number - 1):
            raise OptionError(f"the action of {name} is {_shown(index)}; it must be an index from 0 to {number - 1}")

    def _refuse_name(self, name: str) -> None:
        """Raise `OptionError` if no robot is called `name`."""
        if name not in self._state.problems:
            raise OptionError(f"{_shown(name)} is not a robot of the team; its robots are in possible_agents")

    def _parts_of(self, name: str, action: Action) -> tuple[int, int]:
        """Return the index of the value and the signal in an action. Raises `OptionError`."""
        if not self._signals:
            self._refuse_value(name, action)
            return int(action), 0
        self._refuse_name(name)
        parts = [*action] if isinstance(action, tuple | list | np.ndarray) else []
        if len(parts) != 2:  # noqa: PLR2004 - a value and a signal
            raise OptionError(f"the action of {name} is {_shown(action)}; use a pair of a value's index and a signal")
        self._refuse_value(name, parts[0])
        if not _is_number_in(parts[1], 0, self._signals - 1):
            raise OptionError(f"the signal of {name} is {_shown(parts[1])}; it must be 0 to {self._signals - 1}")
        return int(parts[0]), int(parts[1])

    def _actions_of(self, name: str) -> spaces.Space[Any]:
        number = len(self._state.problems[name].values)
        return spaces.MultiDiscrete([number, self._signals]) if self._signals else spaces.Discrete(number)

    def _observations_of(self, name: str, most: float, constraints: int) -> spaces.Dict:
        """Return the observation space of a robot, where costs are at most `most`."""
        problem = self._state.problems[name]
        shape = (len(problem.values),)
        found: dict[str, spaces.Space[Any]] = {
            "value": spaces.Discrete(len(problem.values)),
            "costs": spaces.Box(0, most, shape, np.float64),
            "violations": spaces.Box(0, constraints, shape, np.int64),
        }
        if sizes := [len(self._domains[variable]) for variable in self._shown_to(name)]:
            found["neighbours"] = spaces.MultiDiscrete(sizes)
        if self._signals and problem.neighbours:
            found["signals"] = spaces.MultiDiscrete([self._signals] * len(problem.neighbours))
        return spaces.Dict(found)

    def _shown_to(self, name: str) -> Iterable[str]:
        """Return the variables of its neighbours that a robot sees."""
        neighbours = self._state.problems[name].neighbours
        return [variable for other in neighbours for variable in self._state.team[other].interface]

    def _observation(self, name: str) -> Observation:
        problem = self._state.problems[name]
        costs = self._state.costs(name)
        found: Observation = {
            "value": np.int64(self._state.values[name]),
            "costs": np.array([cost for _, cost in costs], dtype=np.float64),
            "violations": np.array([broken for broken, _ in costs], dtype=np.int64),
        }
        parts = [part for other in problem.neighbours for part in self._state.announced[other]]
        if shown := [*zip(self._shown_to(name), parts, strict=True)]:
            indices = [self._domains[variable][part] for variable, part in shown if part is not None]
            found["neighbours"] = np.array(indices, dtype=np.int64)
        if self._signals and problem.neighbours:
            found["signals"] = np.array([self._sent[other] for other in problem.neighbours], dtype=np.int64)
        return found

    def _paid(self) -> dict[str, float]:
        """Return the present cost that counts for the reward of each robot."""
        state = self._state
        if self._reward == Reward.TEAM:
            return dict.fromkeys(self.agents, state.weighed(state.team_cost))
        return {name: state.weighed(state.costs(name)[state.values[name]]) for name in self.agents}

    def _infos(self) -> dict[str, dict[str, Any]]:
        cost = self._state.user_cost
        regret = None if self.optimum is None else self.optimum.regret(cost)
        info = {
            "cost": None if cost is None else float(cost),
            "violations": self._state.team_cost[0],
            "regret": regret,
        }
        return {name: dict(info) for name in self.agents}


def parallel_env(problem: Team | HasTeam, **options: Any) -> TeamEnv:  # noqa: ANN401 - those of `TeamEnv`
    """Return the environment in which all robots act at the same time. For the `options` see `TeamEnv`."""
    return TeamEnv(problem, **options)


def env(problem: Team | HasTeam, **options: Any) -> AECEnv:  # noqa: ANN401 - those of `TeamEnv`
    """Return the environment in which the robots act in turn (AEC). They see the new values after the last turn.

    For the `options` see `TeamEnv`.
    """
    return parallel_to_aec(TeamEnv(problem, **options))


def _shown(value: object) -> str:
    """Return a value of the user as one short line."""
    return on_one_line(repr(value))


def _is_number_in(value: object, low: int, high: float) -> bool:
    """Return whether `value` is a whole number from `low` to `high`. Truth values are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and low <= int(value) <= high


def _refuse_options(
    rounds: object, reward: object, signals: object, optimum: object, violation_cost: object, render_mode: object
) -> None:
    """Raise `OptionError` if an argument has a wrong type, or a value that is not allowed."""
    if not _is_number_in(rounds, 1, float("inf")):
        raise OptionError(f"rounds is {_shown(rounds)}; use a whole number of at least 1")
    if not (isinstance(reward, str) and reward in set(Reward)):
        raise OptionError(f"reward is {_shown(reward)}; use {' or '.join(map(repr, map(str, Reward)))}")
    if not (_is_number_in(signals, 0, 0) or _is_number_in(signals, 2, MAX_SIGNALS)):
        raise OptionError(f"signals is {_shown(signals)}; use 0, or 2 to {MAX_SIGNALS}")
    if not isinstance(optimum, str | Optimum | None):
        raise OptionError(f"optimum is {_shown(optimum)}; use the name of a protocol, an Optimum or None")
    number = 0.0 if violation_cost is None else violation_cost
    if not (isinstance(number, int | float) and not isinstance(number, bool) and 0 <= number < float("inf")):
        raise OptionError(f"violation_cost is {_shown(violation_cost)}; use a finite number of at least 0, or None")
    if not (render_mode is None or (isinstance(render_mode, str) and render_mode in {"ansi", "human"})):
        raise OptionError(f"render_mode is {_shown(render_mode)}; use None, 'ansi' or 'human'")
