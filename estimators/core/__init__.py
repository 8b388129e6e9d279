"""Estimation whatever the vehicle: Gaussians, filters, histories, bounds and consistency."""
