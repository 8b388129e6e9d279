"""The water: what its currents are, as data and as fields of time and place."""
