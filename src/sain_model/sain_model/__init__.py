"""The model: physics, identification of its parameters, the network, training and its service."""
