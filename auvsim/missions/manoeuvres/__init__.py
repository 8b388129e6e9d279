"""Standard manoeuvres for identification, and their metrics."""
