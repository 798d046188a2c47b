"""The pages that are different for imported teams and for teams drawn in the application."""
