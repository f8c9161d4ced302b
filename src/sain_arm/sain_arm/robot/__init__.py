"""A robot as its YAML file states it: limits, tool, and a model in MuJoCo."""
