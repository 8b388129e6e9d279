"""Cooperative localisation with late pulses and packets (Yao et al. 2011, and beyond)."""
