"""Pushes of a real robot, from the files of others, as data sets of the ordinary schema."""
