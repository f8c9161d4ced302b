"""Pushes of a recording as rows: one `PushResult` is one row, for all who read recordings."""
