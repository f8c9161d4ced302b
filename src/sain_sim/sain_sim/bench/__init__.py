"""A robot's controller and table in simulation: what a trajectory server is made of, no ROS."""
