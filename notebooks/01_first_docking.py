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
# # A first docking
#
# A torpedo AUV finds a funnel dock 300 m away, knowing only its compass, its depth gauge, the feedback of its fins and shaft, and what the
# dock measures of it acoustically and sends, seconds late. This notebook runs one such trial, looks at what happened, asks how good the
# estimate was, and changes the water.

# %%
import numpy as np
from IPython.display import Image

from auvsim import load_scenario, read_log, run, summarise
from auvsim.analysis import plots

# %% [markdown]
# ## One trial
#
# The default plan is a scenario with distributions in it. Drawn with a seed it is definite: start, dock heading and current are this seed's.

# %%
definite = load_scenario(seed=1)
name, settings = definite.lone  # of the only vehicle
settings.start, definite.structures["dock"], definite.water.current

# %%
log = run(definite, seed=1, path="trial.nc")
vehicle = log.vehicle()
event = vehicle["event"]
for time, kind, text in zip(event["time"], event["kind"], event["text"], strict=True):
    print(f"{time:7.1f} s  {kind:<10} {text}")

# %% [markdown]
# The verdict, from the log alone: everything below works as well on a `trial.nc` that somebody sent you (`read_log`).

# %%
summary = summarise(vehicle)
print(f"docked: {summary['docked']} after {summary['time']:.0f} s, attempt {summary['attempts']}")
print(
    f"nose off the axis at the mouth: {summary['miss_distance']:.2f} m, heading {summary['heading_error_deg']:+.1f} deg"
)
assert summary["docked"]

# %%
plots.track(vehicle, "track.png")
Image("track.png")

# %% [markdown]
# ## How good was the estimate, and did it know?
#
# Bands are two standard deviations of the filter's own covariance. NEES, the squared error over that covariance, should be about 1 per degree of freedom.

# %%
plots.estimates(vehicle, "estimates.png")
Image("estimates.png")

# %% [markdown]
# ## Other water
#
# Whatever is given is no longer drawn; all else, the noises included, stays as it was for this seed. A current of 0.4 m/s that turns by 90 degrees on
# the approach:

# %%
turning = {"kind": "turning", "speed": 0.4, "direction_deg": 30.0, "start": 250.0, "end": 260.0}
in_turn = run(load_scenario(seed=1, current=turning), seed=1)
verdict = summarise(in_turn.vehicle())
print(f"docked: {verdict['docked']} in attempt {verdict['attempts']}, after {verdict['time']:.0f} s")

# %% [markdown]
# ## Two estimators on the same noise
#
# The default is an extended Kalman filter with the current among its states. Paper 1's own filter estimates the current beside a filter that does not know it
# is uncertain. Same seeds, same noise, three trials each.


# %%
def position_rms(kind: str, seed: int) -> float:
    """Rms horizontal position error of an estimator over a trial [m]."""
    result = run(load_scenario(seed=seed, estimator={"kind": kind}), seed=seed)
    return summarise(result.vehicle())["estimate"]["all"]["position_rms"]


errors = np.array([[position_rms(name, seed) for name in ("augmented_ekf", "paper")] for seed in (11, 12, 13)])
for seed, (augmented, paper) in zip((11, 12, 13), errors, strict=True):
    print(f"seed {seed}: augmented {augmented:.2f} m, paper {paper:.2f} m")

# %% [markdown]
# Three trials prove nothing: they show how to compare on paired seeds. The log keeps it all; groups of the vehicle go by their short names
# (`vehicle["truth"]`, `vehicle["compass"]`), and every variable says its units.

# %%
again = read_log("trial.nc").vehicle()
print(again.table("truth")["nu"])
{group: sorted(again[group]) for group in again.groups}
