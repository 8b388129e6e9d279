"""The papers' figures and tables, one package per paper."""
