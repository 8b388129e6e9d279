"""Studies behind the figures of the README, run by `auvsim study NAME`."""
