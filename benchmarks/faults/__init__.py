"""Faults injected below the nodes: see ``benchmarks.graph_faults``."""
