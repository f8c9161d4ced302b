"""A bag as one HTML page that stands alone: what happened, from above and in figures."""
