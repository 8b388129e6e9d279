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
# # Navigation by an imaging sonar
#
# A vehicle that dives dead-reckons from its last fix, and drifts. A forward-looking sonar sees the same floor from frame to frame, and so how far the vehicle moved and turned.
# The shell's forms are `auvsim reproduce paper5` and `auvsim run survey`.

# %%
import numpy as np
from matplotlib import pyplot as plt

from auvsim.analysis import bound_maps, floor_bound_files
from auvsim.analysis.floor_bound import floor_bound
from auvsim.analysis.sonar_map import map_figure
from auvsim.reproduce.paper5.methods import METHODS, TITLES, frame_model
from auvsim.reproduce.paper5.scenes import GRID, Conditions, arc, simulate
from auvsim.simulation.loading import load_scenario
from estimators.map_path.bound_map import height_information, match_bound
from estimators.map_path.likelihood import Matcher

# %% [markdown]
# ## What a frame shows
#
# Frames of 0 dB, as in the paper: a feature is as strong as the noise. To the right the same frame by the filter that the likelihood is made of. Below, a ray-cast frame of a rough
# floor with rocks: grazing angles, shadows, speckle that is new each time.

# %%
run = simulate(arc(Conditions()), seed=7)
matcher = Matcher(GRID, frame_model(run.conditions))
floor = simulate(arc(Conditions(frames="floor", snr=6.0, duration=2)), seed=7)
seen = {
    "features and noise, 0 dB": run.frames[0].intensity,
    "the same, filtered": matcher.prepare(run.frames[0].intensity).values,
    "ray-cast: rocks on a rough floor": floor.frames[0].intensity,
}
figure, panels = plt.subplots(1, 3, figsize=(13.0, 3.6), layout="constrained")
for axes, (title, image), grid in zip(panels, seen.items(), (GRID, GRID, floor.grid), strict=True):
    image, (ahead, across) = np.where(image == 0.0, np.nan, image), np.multiply(grid.shape, grid.cell)
    low, high = np.nanpercentile(image, (2.0, 99.5))
    extent = (-0.5 * across, 0.5 * across, 0.0, ahead)
    axes.imshow(image, origin="lower", extent=extent, cmap="magma", vmin=low, vmax=high)
    axes.set(title=title, xlabel="to starboard [m]", ylabel="ahead [m]")

# %% [markdown]
# ## Paths
#
# One minute at 1.5 m/s on an arc, by an odometer with errors of speed and turn rate. Dynamic programming keeps what each frame says of the odometer's errors and takes the most probable path
# of all; the window compares each frame with several before it. One run says little: the intervals are in `docs/sonar_navigation.md`.

# %%
tracks = {name: METHODS[name](run) for name in ("dead_reckoning", "dp", "window")}
errors = {}
figure, axes = plt.subplots(figsize=(7.0, 6.0), layout="constrained")
axes.plot(run.poses[:, 1], run.poses[:, 0], "k", label="truth")
for name, track in tracks.items():
    rms = errors[name] = np.sqrt(np.mean(np.sum((track.poses - run.poses)[1:, :2] ** 2, axis=1)))
    print(f"{TITLES[name]}: rms {rms:.2f} m")
    axes.plot(track.poses[:, 1], track.poses[:, 0], "--", label=f"{TITLES[name]}, rms {rms:.1f} m")
axes.set(aspect="equal", xlabel="east [m]", ylabel="north [m]")
axes.legend()
print("the window below a tenth of dead reckoning:", bool(errors["window"] < 0.1 * errors["dead_reckoning"]))
# %% [markdown]
# ## The map that comes of it

# %%
frames = [matcher.prepare(frame.intensity).values for frame in run.frames]
map_figure(frames, tracks["window"].poses, GRID)

# %% [markdown]
# ## Where matching will hold, before the mission
#
# The bound of a match about each place of a height field: a floor whose roughness grows to the east, with long ripples in the north, along which nothing tells.

# %%
rng = np.random.default_rng(3)
north, east = np.arange(0.0, 120.0, 0.5), np.arange(0.0, 120.0, 0.5)
height = 0.002 * rng.normal(size=(north.size, east.size)) * (1.0 + 10.0 * east / east[-1])
height[160:] = 0.05 * np.sin(2.0 * np.pi * north[160:, None] / 3.0)
bound = match_bound(height_information(height, 0.5, 0.3, gain=30.0), 0.5, GRID, noise=1.0)
figure, axes = plt.subplots(figsize=(7.0, 5.6), layout="constrained")
chart = bound_maps.BoundMap(north=north[::4], east=east[::4], bound=bound[::4, ::4])
bound_maps.draw(axes, chart, title="Where matching will hold", quantity="least deviation of one match, worst axis [m]")

# %% [markdown]
# The same of a mission's own floor and sonar, with its lanes: relief and rocks against speckle and noise, from the altitude of the survey. The shell's form is
# `auvsim floor survey`, or `auvsim floor depths.nc` of a grid of your own.

# %%
found = floor_bound(load_scenario("survey", water={"terrain": {"rocks": 0.01, "roughness": 0.15}}))
print(
    f"one match to 0.1 m on {(found.bound <= 0.1).mean():.0%} of the floor, {(found.along <= 0.1).mean():.0%} of the lanes"
)
floor_bound_files.figure(found, holds=0.1)

# %% [markdown]
# `auvsim run survey --seed 1` is a mission with all of it: a GPS fix, a dive, lanes over a generated floor, home to the dock by DVL and sonar. It leaves the errors (`sonar.png`), the
# feature map as a picture and, with the pose, attitude and covariance of each keyframe, as data (`feature_map.png`, `feature_map.nc`), and a video.
