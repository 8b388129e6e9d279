"""Analysis of logs: errors of estimates, plots and their style."""
