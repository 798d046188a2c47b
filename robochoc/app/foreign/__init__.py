"""Teams that were not drawn in the application: what is known of their files, in words and as a picture."""
