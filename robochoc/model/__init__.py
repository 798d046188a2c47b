"""The problem as data: teams, robots, domains, constraints, expressions, changes, orders, outcomes."""
