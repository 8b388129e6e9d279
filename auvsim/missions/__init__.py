"""Missions: from an estimate to setpoints, with their phases, log variables and metrics."""
