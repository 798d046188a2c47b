"""The page `fly` of a team."""
