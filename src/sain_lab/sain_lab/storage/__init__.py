"""The folder of a laboratory: its log, the results in it, and recordings that are added."""
