"""The live page: the arm, the bodies, plans and goals in a browser."""
