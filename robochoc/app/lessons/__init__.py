"""Ten short lessons on how robots decide together: data, recorded runs, pictures. No web is in here."""
