"""The pages of the application, built with NiceGUI."""
