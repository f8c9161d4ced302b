"""Guards that need ROS: of messages, of topics with one owner, of the state after a crash."""
