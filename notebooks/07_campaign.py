# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A campaign
#
# One trial proves nothing. A campaign runs the same trials with each of several variants, on every core, keeps each as soon as it is finished, and says what
# they came to: rates with intervals, paired differences, and a report that opens in any browser. On the command line all of this is `auvsim campaign`.

# %%
from pathlib import Path

import numpy as np
from IPython.display import IFrame

from auvsim import run, summarise
from auvsim.campaign import execution, local, plan, report, statistics, table
from auvsim.simulation import scenario

# %% [markdown]
# ## The plan
#
# `base` is what differs from the default scenario, distributions included; each variant pins something more. All variants see the same draws and the same noises.

# %%
document = {
    "name": "two_filters",
    "seed": 5,
    "trials": 4,
    "base": {
        "current": {"kind": "uniform", "speed": {"uniform": [0.0, 0.5]}, "direction_deg": {"uniform": [-180.0, 180.0]}}
    },
    "variants": {
        "augmented_ekf": {"estimator": {"kind": "augmented_ekf"}},
        "paper": {"estimator": {"kind": "paper"}},
    },
}
chosen = plan.parse(document)
print("drawn for each trial:", *chosen.drawn)
chosen.values("paper", 0)["current"], chosen.values("augmented_ekf", 0)["current"]

# %% [markdown]
# ## Running it
#
# What the folder holds already does not run again: a campaign that was cut short, by whatever, goes on where it was. So does one that is to have more trials.

# %%
with local.Pool(execution.cores()) as pool:
    before = len(list(execution.run(chosen, Path("two_filters"), pool).records()))
    folder = execution.run(plan.parse(document | {"trials": 6}), Path("two_filters"), pool)
rows = list(table.rows(folder))
print(f"{before} trials, then {len(rows)}")

# %% [markdown]
# The table has one row for each trial of each variant, in `table.parquet` and `table.csv` as well.

# %%
print(f"{'variant':<14} trial  docked  attempts  miss [m]  position rms [m]  current [m/s]")
for row in rows:
    numbers = f"{row['miss_distance'] or np.nan:8.2f}  {row['position_rms']:16.2f}  {row['current.speed']:13.2f}"
    print(f"{row['variant']:<14} {row['trial']:5}  {row['docked']!s:>6}  {row['attempts']:8}  {numbers}")

# %% [markdown]
# ## What it comes to
#
# Six trials leave wide intervals, and say so. Differences are taken trial by trial, since both variants met the same water: that is what makes a few trials tell much.

# %%
for rate in statistics.rates(rows, chosen.variants, chosen.layout):
    print(
        f"{rate.variant:<14} {rate.quantity:<13} {rate.successes} of {rate.trials}, 95 % interval {rate.low:.0%} to {rate.high:.0%}"
    )

# %%
for d in statistics.differences(rows, chosen.variants, chosen.layout):
    print(f"{d.variant} less {chosen.variants[0]}: {d.quantity:<15} {d.value:+8.3f}  ({d.low:+.3f} to {d.high:+.3f})")

# %%
for nees in statistics.consistency(rows, chosen.variants, chosen.layout):
    if nees.phase == "all":
        print(
            f"{nees.variant:<14} NEES per axis {nees.mean:6.2f}, of a consistent filter {nees.low:.2f} to {nees.high:.2f}"
        )

# %% [markdown]
# ## One trial again
#
# Every row names its trial, and the plan, the variant and that number are all it takes to run it again, alone, with a log and a video. The command stands in the
# table and in the report.

# %%
worst = max(rows, key=lambda row: row["miss_distance"] or 0.0)
definite = scenario.parse(chosen.values(worst["variant"], worst["trial"]))
again = run(definite, seed=worst["seed"], trial=worst["trial"])
same = summarise(again.vehicle())["miss_distance"] == worst["miss_distance"]
print(worst["command"])
print(f"the same to the last bit: {same}")

# %% [markdown]
# ## The report
#
# One file, without a network: choose variants, click a cell of the map or a kind of failure, and it lists those trials with the commands that replay them.

# %%
path = report.write(folder.path)
print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
IFrame(str(path), width="100%", height=600)
