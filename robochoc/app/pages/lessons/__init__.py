"""The pages of the lessons: the list, and one lesson."""
