"""Ten short lessons on how robots decide together: data, recorded runs and pictures, without NiceGUI."""
