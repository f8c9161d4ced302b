"""Parts of your own."""
