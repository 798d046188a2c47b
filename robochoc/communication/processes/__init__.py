"""The default runtime: one operating system process per robot, connected by multiprocessing queues."""
