"""Scenarios, controllers, the closed loop without ROS, statistics, reports and pictures."""
