"""The rules on which problems, protocols, runtimes and options can be combined. No other package decides this.

Each rule has a condition, the reason, and an alternative:

- `option_rules.py`: options that cannot be combined with each other, whatever the problem is;
- `team_rules.py`: options that cannot be combined with the team, or with the traits of the protocol;
- `setting_rules.py`: settings that the protocol does not have or accept;
- `channel_rules.py`: channel models that do not fit the team;
- `protocols/requirements.py`: costs and kinds of constraints that the protocol does not support. Robots on a network
  use it to check their own files, since the master does not see them.

Messages call the options by their command-line names.
"""
