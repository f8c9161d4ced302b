"""What goes wrong: killed processes, hostile messages and files, a table with an arm."""
