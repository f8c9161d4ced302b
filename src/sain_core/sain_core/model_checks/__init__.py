"""Checks of models from any package: of the whole contract, and of each answer."""
