"""Jobs: work in a thread and in child processes, which can be ended in bounded time."""
