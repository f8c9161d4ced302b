"""Colours and figures, the same in every picture and page. May import `sain_core` only."""
