"""What goes wrong: killed processes, full disks, hostile messages and files, hours of use."""
