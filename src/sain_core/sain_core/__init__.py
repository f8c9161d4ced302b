"""The shared words of SAIN: scenes, pushes, dynamics, settings and errors. No ROS here."""
