"""The recorder: the one part of this package that needs ROS."""
