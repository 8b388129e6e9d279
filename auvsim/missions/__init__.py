"""Missions: setpoints from the estimate, with phases, log variables and metrics."""
