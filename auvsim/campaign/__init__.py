"""Campaigns: many trials of a plan on all cores or a cluster, none lost, and their statistics.

`execution.run(plan.load("navigators"), Path("out"))` runs what its folder does not hold yet; each finished trial is a
file of its own there (`folder`), of which everything else is made: `table`, `statistics`, `report`.
"""
