"""Communication Management unit: moves messages between robots, in one thread, between processes or over a network."""
