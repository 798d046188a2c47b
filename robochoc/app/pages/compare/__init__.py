"""The page `compare` of a team."""
