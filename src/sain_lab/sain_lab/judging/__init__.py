"""Who predicts best, what follows from it, and what of it is shown."""
