"""Sampling-based planning of pushes: MPPI over any model of the pushes. No ROS here."""
