"""Water: currents as settings and as fields of time and place, the sea surface, the sea floor."""
