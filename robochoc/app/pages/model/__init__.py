"""The page `model` of a team."""
