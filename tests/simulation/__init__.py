"""`make simulate`: whole runs in virtual time, in which one seed decides the problem, the options and all faults."""
