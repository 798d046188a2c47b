"""Problem families on a map: a robot's values are the cells that it can reach, and travel times are costs."""
