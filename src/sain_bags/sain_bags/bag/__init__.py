"""What describes a bag: metadata, message definitions and layouts. May import `mcap`."""
