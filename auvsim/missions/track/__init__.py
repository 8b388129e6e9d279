"""Tracks: waypoints, lawn-mowers and the like, followed by line of sight."""
