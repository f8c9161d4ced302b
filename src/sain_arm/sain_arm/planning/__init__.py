"""From a push to a checked trajectory of the joints. No middleware here."""
