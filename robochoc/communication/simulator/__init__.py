"""The simulator: a whole team in one thread, deterministic from a seed; its schedules and channel models."""
