"""The papers of `auvsim reproduce`: what each prints and writes, one module for each."""
