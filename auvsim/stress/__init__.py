"""Stress: where a scenario breaks, by campaigns that choose their trials: edges, maps, rare events, worst currents."""
