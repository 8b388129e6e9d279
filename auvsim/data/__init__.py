"""What a run leaves: the log, its file format, and what records it."""
