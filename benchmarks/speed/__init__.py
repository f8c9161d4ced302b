"""How fast things are, beside what others offer; no data are needed."""
