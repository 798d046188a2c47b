"""The pages for lessons: the list, and a single lesson."""
