"""The benchmark set and the leaderboard: `robochoc leaderboard`.

`instances` defines the set, `certificates` the published list of its digests and optima. `running` runs protocols under
a budget, `results` reads and writes their results, `scores` compares them, `verification` checks them, and `site` shows
them.
"""
