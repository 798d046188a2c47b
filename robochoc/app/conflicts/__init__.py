"""Which rules are in each other's way: a minimal set of rules that cannot hold together, without the web."""
