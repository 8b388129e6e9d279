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
# # Vehicles that talk
#
# A leader navigates well and tells every eight seconds where it is. A follower beside it has a compass, a depth gauge and a DVL that does not reach the sea floor: it
# knows its velocity through the water, and nothing of the current that carries both. The travel time of each packet is a range to where the leader was. On the command
# line: `auvsim run leader_follower`.

# %%
from dataclasses import replace
from pathlib import Path

import numpy as np

from auvsim import load_scenario, read_log, run
from auvsim.analysis.network_plots import network_figure, packets
from auvsim.replay import trial_logs
from auvsim.replay.run import replay

# %% [markdown]
# ## Who hears whom
#
# The scenario is shipped; what is pinned here replaces what it says. Each packet has a row for each receiver in the log, with its fate.

# %%
path = Path("cooperative.nc")
plan = load_scenario("leader_follower", duration=600.0)
log = run(plan, seed=3, path=path)
rows = packets(log)
fates, counts = np.unique(rows["fate"].tolist(), return_counts=True)
print("; ".join(f"{fate}: {count}" for fate, count in zip(fates, counts, strict=True)))

# %% [markdown]
# Above each line what a vehicle sends, on it what it hears, below it what it loses. The bounds are those that each filter claims.

# %%
network_figure(log)


# %% [markdown]
# ## What follows from it
#
# A log holds what the vehicle received, so that its estimator, or another, can be asked again: here, what it would have made of silence. It knows how little it knows
# then: its bounds grow with the current that it cannot see.


# %%
def errors(estimates) -> tuple[float, float]:
    """Largest horizontal error after 400 s, and the largest standard deviation claimed [m]."""
    truth = read_log(path).vehicle("follower")["truth"]
    late = [e for e in estimates if e.time > 400.0]
    there = np.array([[np.interp(e.time, truth["time"], truth["position"][:, k]) for k in range(2)] for e in late])
    off = np.array([e.position[:2] for e in late]) - there
    return float(np.hypot(*off.T).max()), float(np.sqrt(max(np.trace(e.horizontal_covariance) for e in late)))


recording = next(r for r in trial_logs.recordings(path) if r.name.endswith("follower"))
found = {
    name: errors(replay(heard)[0].estimates)
    for name, heard in (("with packets", recording), ("in silence", replace(recording, messages=())))
}
for name, (error, claimed) in found.items():
    print(f"{name:<13} error at most {error:6.1f} m, claimed {claimed:6.1f} m")
print("twenty times worse in silence:", found["in silence"][0] > 20.0 * found["with packets"][0])

# %% [markdown]
# ## Clocks
#
# A range by one-way travel time is as wrong as the two clocks are apart. With 5 ms between them, every range is 7.5 m off; the follower's filter, which does not estimate
# clocks, is now wrong by more than it says. Two-way ranges (`modem.ask`) need no common clock, but a question and an answer for every range.

# %%
late = load_scenario("leader_follower", duration=300.0, vehicles={"follower": {"clock": {"offset": 0.005}}})
shifted, common = run(late, seed=3), run(load_scenario("leader_follower", duration=300.0), seed=3)
ranges = [found.vehicle("follower")["received"]["range"] for found in (shifted, common)]
offset = float(np.mean(ranges[0] - ranges[1]))
print(f"ranges are {offset:.2f} m longer: {abs(offset - 1500.0 * (0.005 - 0.0001)) < 0.1}")
