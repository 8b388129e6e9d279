"""Estimation for any vehicle: Gaussians, filters, histories, bounds and consistency."""
