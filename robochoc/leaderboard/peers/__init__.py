"""Other DCOP tools on the leaderboard: FRODO, pyDCOP and PropFlow.

`peer` is the interface of an adapter, with one module for each tool; `running` runs them on instances and checks their
answers, `claims` compares what they state about their answers with the check. `scripts` run in the Python of a tool,
which has no robochoc.
"""
