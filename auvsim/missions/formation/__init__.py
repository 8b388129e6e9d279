"""Formations: several vehicles at stations about a point that moves, and a follower that chooses its own."""
