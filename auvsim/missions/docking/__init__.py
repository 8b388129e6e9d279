"""Docking: guidance into a funnel dock, and what a docking log says."""
