"""Jobs: work in a thread and its child processes, which can be ended in bounded time."""
