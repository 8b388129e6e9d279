"""Paper 4, Li et al. (2023): formations, and what ranges to leaders tell a follower."""
