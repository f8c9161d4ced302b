"""From images to poses of bodies on the table. No middleware here."""
