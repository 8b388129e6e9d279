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
# # Identification
#
# What a docking filter assumes of its vehicle is some thirty coefficients. Tables and strip theory give them to within some ten per cent; a sea trial of five
# minutes tells more, if it is asked the right questions. This notebook drives manoeuvres, fits the planar model to what was measured, judges it on a
# manoeuvre that it has not seen, asks what the data could not tell, and docks with the result. In the shell: `auvsim manoeuvre`, `auvsim identify`,
# `auvsim dock --estimator.model`.

# %%
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from auvsim import load_scenario, run, summarise
from auvsim.base.errors import InputError
from auvsim.identification import pictures, product
from auvsim.identification.pipeline import identify
from auvsim.identification.readers import read
from auvsim.physics import planar_sets
from auvsim.simulation import sampling, scenario

# %% [markdown]
# ## Manoeuvres
#
# A multisine puts over the rudder at many frequencies at once, with steps of speed: at one speed nobody could tell thrust from drag. A zig-zag goes from side to
# side. A turning circle is held out. Each vehicle carries the trial's compass, a gyro and a DVL, all with their noises and constant errors; the dock measures
# where it is every five seconds.


# %%
def drive(kind: str, duration: float) -> Path:
    """The log of a manoeuvre of the MuJoCo vehicle."""
    plan = sampling.merge(sampling.manoeuvre_plan(kind), {"manoeuvre": {"kind": kind, "duration": duration}})
    path = Path(f"{kind}.nc")
    run(scenario.parse(sampling.draw(plan, seed=3)), seed=3, path=path)
    return path


fitted = read([drive("multisine", 170.0), drive("zigzag", 130.0)])
held_out = read([drive("circle", 260.0)])
for record in (*fitted.records, *held_out.records):
    rates = np.isfinite(record.measured).sum(axis=0) / record.duration
    print(
        f"{record.kind:<10} {record.duration:.0f} s; heading at {rates[2]:.1f}, log at {rates[3]:.1f}, fixes at {rates[0]:.2f} Hz"
    )

# %% [markdown]
# The reader takes a user's CSV or NetCDF just as well, whatever its columns are called, and says what cannot be right. A rudder in degrees, called radians:

# %%
rows = ["time [s],rudder [rad],n [rpm],heading [deg]"]
rows += [f"{0.1 * k:.1f},{10.0 * np.sin(0.05 * k):.2f},900,{20.0 * np.sin(0.05 * k - 1.0):.2f}" for k in range(600)]
Path("wrong.csv").write_text("\n".join(rows))
try:
    read([Path("wrong.csv")])
except InputError as error:
    print(error)

# %% [markdown]
# ## The fit
#
# Three steps. Least squares of smoothed velocities; then segments of some seconds, each from a first state of its own, so that no error of the model grows; then
# the likelihood of a filter's own innovations, which bears what the model lacks as noise of the process. It starts from the model fitted to the vehicle's
# hydrodynamics in MuJoCo, which is good already.

# %%
found = identify(fitted, held_out)
for verdict in found.verdicts:
    print("+" if verdict.good else "!", verdict.text)

# %%
print(f"{'':<6}{'start':>10}{'fit':>10}   95 % interval")
for name in found.identifiability.names:
    low, high = found.intervals[name]
    start, value = getattr(found.start, name), getattr(found.fit.parameters, name)
    print(f"{name:<6}{start:10.4g}{value:10.4g}   {low:.4g} to {high:.4g} {planar_sets.UNITS[name]}")

# %% [markdown]
# ## What it is worth
#
# On the circle the model runs open loop: rudder and shaft are all it is given. The error grows with the distance run, and so is shown by it.

# %%
figure = Figure(figsize=(10, 4), layout="constrained", dpi=70)
track, growth = figure.subplots(1, 2)
pictures.track_panel(track, pictures.hardest(found))
pictures.growth_panel(growth, found)
figure

# %%
print(
    f"position error after {found.judged[0].seconds:.0f} s: start {found.start_share:.2%}, fit {found.share:.2%} of the distance run"
)
print(f"below 2 %: {found.share < 0.02}; better than its start: {found.better}")

# %% [markdown]
# ## What the data could not tell
#
# Intervals of single parameters say too little: what is not known is often a combination. The worst known, in shares of the parameters:

# %%
for combination in found.identifiability.combinations[:-5:-1]:
    print(f"{combination.deviation:7.1%}  {combination.text}")
print("go together:", ", ".join(f"{a} and {b} ({r:+.2f})" for a, b, r in found.identifiability.tied))

# %% [markdown]
# Drag and the loss of thrust are one brake to the vehicle: more of one and less of the other moves it the same way. Their sum is known, and it is the sum that
# predicts.

# %%
figure = Figure(figsize=(6, 4), layout="constrained", dpi=70)
pictures.parameter_panel(figure.subplots(), found, numbers=False)
figure

# %% [markdown]
# ## Docking with it
#
# A parameter file holds values, units, intervals, and where they came from. An estimator uses it by name or path.

# %%
planar_sets.write(product.planar_set(found), Path("lake.yaml"))
for model in ("condense", "lake.yaml"):
    summary = summarise(run(load_scenario(seed=3, estimator={"model": model}), seed=3).vehicle())
    rms = summary["estimate"]["all"]["position_rms"]
    print(f"{model:<10} docked: {summary['docked']}, position of the estimate {rms:.2f} m rms")

# %% [markdown]
# One trial proves nothing, and the fitted model is good: `auvsim study identified_docking lake.yaml` runs a hundred with each model, and with a
# third one that is wrong by a fifth.
