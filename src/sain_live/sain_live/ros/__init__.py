"""The page as a ROS 2 node: topics, services and actions only."""
