"""The simulator: a whole team in one thread, deterministic for a given seed, with its schedules and channel models."""
