"""The page `decide` of a team."""
