"""Lists of robots and tasks (`tasks.yaml`): what their entries say, and the team that follows."""
