"""Pushes of a real robot: who predicts them how well. ``make real`` writes results/real/real.md.

What is computed is kept in a folder of work (`kept`), the measures of it are one JSON file
(`measures`), and the page is made from that file alone (`page`).
"""
