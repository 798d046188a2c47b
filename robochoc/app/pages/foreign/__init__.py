"""The pages of a team that was not drawn here, where they are others than those of a team that was."""
