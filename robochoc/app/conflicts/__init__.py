"""Which rules are in each other's way: a smallest set of rules that cannot hold together, without the web."""
