"""The default runtime: one operating system process per robot, joined by multiprocessing queues."""
