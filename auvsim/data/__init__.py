"""Data: the log of a run, its file format and its recorder."""
