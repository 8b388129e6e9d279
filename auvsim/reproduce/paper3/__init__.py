"""Paper 3: cooperative localisation with late pulses and packets (Yao et al. 2011)."""
