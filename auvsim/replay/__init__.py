"""Logs through estimators again: any trial's, or a user's table, with losses, delays and outliers to try."""
