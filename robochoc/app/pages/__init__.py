"""The pages of the application, made with NiceGUI."""
