"""Routes of many drones that keep their distance: which way each goes, and when (`timetable.plan`)."""
