"""Parameters of the planar model from records of manoeuvres."""
