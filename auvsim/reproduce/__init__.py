"""The papers' figures and tables, one file a paper."""
