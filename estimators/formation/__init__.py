"""Followers that locate themselves by ranges to leaders: what a formation can tell, and filters (Li et al. 2023)."""
