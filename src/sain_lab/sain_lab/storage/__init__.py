"""The folder of a laboratory: its log, the results in it, and recordings as results."""
