"""PettingZoo environments for teams: learning agents choose the robots' values (the extra `rl`).

>>> import robochoc
>>> from robochoc.environments import parallel_env
>>> env = parallel_env(robochoc.load("instances/queens3d-4"), optimum=None)
>>> observations, infos = env.reset(seed=1)
>>> env.num_agents
16
"""

from robochoc.environments.array_env import ArrayEnv, Observations
from robochoc.environments.team_env import ENV_NAME, TeamEnv, env, parallel_env

__all__ = ["ENV_NAME", "ArrayEnv", "Observations", "TeamEnv", "env", "parallel_env"]
