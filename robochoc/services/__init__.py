"""The Services Management unit: the Directory Facilitator, which knows each robot's services."""
