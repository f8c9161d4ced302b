"""Closed loops without ROS, many of them, and their results. May import `scenes` and `plots`."""
