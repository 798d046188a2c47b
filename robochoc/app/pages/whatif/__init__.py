"""The page `whatif` of a team."""
