"""All that a simulator node calls, without ROS. May import `world`."""
