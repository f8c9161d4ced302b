"""The page itself, on viser. It does not import ROS."""
