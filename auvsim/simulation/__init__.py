"""Simulation: scenarios, how they are drawn, agents, and the loop that runs them."""
