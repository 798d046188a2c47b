"""The team in 3D: drones on the ground, then flying to their places (Section 5, Figures 5 and 6)."""
