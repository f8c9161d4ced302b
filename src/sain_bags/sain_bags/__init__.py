"""Recordings: bags in the rosbag2 layout, written and read; only `ros` needs ROS."""
