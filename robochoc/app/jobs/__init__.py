"""Jobs: work in a thread of its own with the processes that it starts, ended in bounded time."""
