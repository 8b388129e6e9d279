"""Missions of hovering vehicles: to hold a place, and to dock by creeping in."""
