"""What installed packages add by entry points: found, loaded, and blamed if it fails."""
