"""Docking: guidance into a funnel dock, and metrics of docking logs."""
