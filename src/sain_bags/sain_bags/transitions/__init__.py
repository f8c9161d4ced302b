"""ChannelMessages become rows: pushes paired by id. May import `reading`."""
