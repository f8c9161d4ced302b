"""Every kind of model behind one contract, and its checkpoints. May import `data`."""
