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
# # Formations
#
# A follower with a compass and a speed log hears ranges to leaders that know where they are. Where should they stand, and what can go wrong? The shell's forms are
# `auvsim formation`, `auvsim reproduce paper4` and `auvsim run formation`.

# %%
import numpy as np

from auvsim.analysis import formation_map
from auvsim.cli.formation import formation
from auvsim.reproduce.paper4 import line, runs, study
from auvsim.reproduce.paper4.formations import FORMATIONS
from estimators.formation import bounds, placement

# %% [markdown]
# ## One set of ranges
#
# The least error depends on bearings alone: the determinant of the bound is the fourth power of the ranges' deviation over S1, the sum of squared sines of the
# differences of bearings. Three leaders 120 degrees apart are best; leaders in one line with the follower tell nothing across it.

# %%
for number in (1, 2, 5, 3):
    B = bounds.crlb(np.zeros(2), FORMATIONS[number], 2.0)
    print(f"formation {number}: least rms error {np.sqrt(np.trace(B)):.2f} m")
found = np.degrees(np.sort(placement.optimise_bearings(np.ones(3))))
print("a search finds bearings of", found.round(3), "degrees")

# %% [markdown]
# ## A map, and who should move
#
# Leaders on a line, ranges of 2 m. Hatched is where a follower should not rely on ranges. Each dashed arrow is the best that one leader can do alone.

# %%
judged = formation(
    "0,-100;0,100;0,200", "0,0", "2", speed=1.0, heading_deg=0.0, step=1.0, reach=80.0, modem=500.0, apart=20.0
)
judgement = formation_map.judge(judged)
print(f"now {judgement.steady} m, with the best move of leader 1 {judgement.moves[0].rms:.2f} m")
formation_map.draw(judged, judgement)

# %% [markdown]
# ## Filters
#
# In a good formation the extended filter reaches the bound, and no other does better on the same model. On a line it is the curvature of the ranges that holds the error, and a filter
# that knows of it does better. So does one that knows that a vehicle's velocity does not jump.

# %%
for number in (6, 8):
    key = study.Key(1.0, 1.0, 4.0, number)
    results = study.cell(key, seed=1, count=20)
    print(
        f"formation {number}, bound {study.steady_bound(key):.2f} m:", {n: f"{r.rms:.2f}" for n, r in results.items()}
    )

# %% [markdown]
# ## The mirror trap
#
# Leaders a little to one side of the follower: it knows how far it is from their line, and not on which side. What its filter claims gets better, the error gets worse.

# %%
on, aside = (line.trapped("one side", offset, seed=1, count=20) for offset in (0.0, 5.0))
for name, trap in (("on the line", on), ("5 m to one side", aside)):
    print(f"{name}: rms {trap.rms:.1f} m, the filter claims {trap.claimed:.1f} m, NEES {trap.nees:.1f}")
print("worse, and claims to be better:", aside.rms > on.rms and aside.claimed < on.claimed)

# %% [markdown]
# ## Leaders move
#
# A line that weaves keeps the follower located; what it costs in speed of the leaders is small.

# %%
case = runs.Case(leaders=FORMATIONS[8], speed=1.0, variance=4.0, duration=600.0)
noise = runs.noise(1, 20, case.steps, 3)
for name in ("hold", "weave 30 m"):
    tracks = runs.follow(case, noise, "second_order", manoeuvre=line.manoeuvre(name))
    print(f"{name}: {runs.a_rms(tracks).mean():.2f} m")
