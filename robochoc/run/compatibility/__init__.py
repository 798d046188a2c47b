"""The rules on which problems, protocols, runtimes and options can be combined. No other room decides this.

There are three lists. Each rule has a condition, the reason, and what to do instead:

- `option_rules.py`: options that do not go together, whatever the problem is;
- `team_rules.py`: options that do not go with the problem, or with what the protocol can do (its traits);
- the constraints that a protocol must be able to take (`protocols/requirements.py`, where robots on a network, whose
  files nobody else sees, ask as well).

The command line, the API, and robots on a network ask here. Options are named as on the command line.
"""
