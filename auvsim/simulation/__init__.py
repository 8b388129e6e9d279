"""Simulation: scenarios, how they are drawn, and the loop that runs them."""
