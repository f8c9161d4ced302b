"""What comes from others, and what becomes of processes: each guard once, and all of them here."""
