"""The simulator without ROS: worlds, ids, time. May import `world`."""
