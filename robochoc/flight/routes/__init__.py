"""Routes of many drones that keep their distance: paths, and when each drone flies (`timetable.plan_routes`)."""
