"""The shared ROS side: codec, parameters from dataclasses, quality of service, the node main."""
