"""The model as a ROS 2 service."""
