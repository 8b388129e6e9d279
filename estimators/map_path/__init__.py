"""Navigation by an imaging sonar: the path itself is estimated, from frame to frame, with the sea floor as the map."""
