"""Programs that run in the Python of a peer, which has no robochoc."""
