"""The planar prior, its kernels, and what it infers or corrects. May import `compute`."""
