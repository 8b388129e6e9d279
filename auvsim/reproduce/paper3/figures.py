"""Pictures of the study of paper 3: when what arrives, tracks and errors, the leader predicted, delay and loss."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from auvsim.analysis.style import dress
from auvsim.reproduce.paper3.follow import SAMPLE, deliver
from auvsim.reproduce.paper3.methods import METHODS
from auvsim.reproduce.paper3.study import BOUND_TIMES, DELAYS, LOSSES, POOLED, Study
from auvsim.reproduce.paper3.truths import STEP, Conditions, Run, simulate
from estimators.core.types import Array
from estimators.path_prediction.messages import Packet

COLOURS = {
    "dr": "#7f7f7f",
    "ekf": "#d62728",
    "dekf": "#ff7f0e",
    "iiru": "#1f77b4",
    "sc": "#2c7a2c",
    "rt": "#9467bd",
    "choosing": "#17a2a2",
    "oracle": "#000000",
}
TRUTH, BOUND = "#000000", "#888888"
SECONDS_SHOWN = 45.0  # of the timing diagram


def draw(study: Study) -> dict[str, Figure]:
    """The pictures by file name, of the rows that were run."""
    found = {
        "figure1.png": timing(study.seed),
        "figure2.png": tracks_and_errors(study),
        "figure3.png": leader(study.seed),
    }
    if any(name.startswith("delay_fine") for name in study.results):
        found["delay.png"] = delay(study)
    if any(name.startswith("loss_fine") for name in study.results):
        found["loss.png"] = loss(study)
    return found


def timing(seed: int) -> Figure:
    """Figure 1: pulses and packets between leader and follower, in order and out of order."""
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    stated = simulate(Conditions(noise="paper"), seed, 0)
    shuffled, first = _shuffled(seed)
    panels = ((stated, 0, "packets in order, sigma of the delay 1 s"), (shuffled, first, "out of order, sigma 6 s"))
    for axes, (run, start, title) in zip(figure.subplots(2, 1), panels, strict=True):
        period = run.conditions.period
        low, high = start * period - 2.0, start * period + SECONDS_SHOWN
        for event in run.events:
            is_packet = isinstance(event, Packet)
            sent = event.stamp if is_packet else event.emitted
            arrived = event.received if is_packet else event.detected
            if not (low <= sent <= high and arrived <= high):
                continue
            colour = COLOURS["iiru"] if is_packet else COLOURS["ekf"]
            axes.annotate("", (arrived, 0.0), (sent, 1.0), arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.6})
            low_text = -0.28 - 0.14 * (event.number % 2) if is_packet else -0.12
            axes.text(
                arrived, low_text, f"{'packet' if is_packet else 'pulse'} {event.number}", color=colour, ha="center"
            )
        axes.axhline(1.0, color="#444444", lw=1.0)
        axes.axhline(0.0, color="#444444", lw=1.0)
        axes.set_yticks([0.0, 1.0], ["follower", "leader"])
        axes.set_ylim(-0.52, 1.2)
        axes.set_xlim(low, high)
        dress(axes, title, "time [s]", "")
    return figure


def tracks_and_errors(study: Study) -> Figure:
    """Figure 2: tracks of a run at paper noise, and rms errors over all, with the bound."""
    figure = Figure(figsize=(14.0, 6.0), layout="constrained")
    left, *right = figure.subplots(1, 3)
    run = simulate(Conditions(noise="paper"), study.seed, 0)
    left.plot(run.follower[:, 1], run.follower[:, 0], color=TRUTH, lw=2.0, label="follower, truth")
    left.plot(run.leader[:, 1], run.leader[:, 0], color=TRUTH, ls=":", label="leader, truth")
    for key in ("dr", "ekf", "dekf", "iiru", "sc", "rt"):
        north, east = _track(key, run).T
        left.plot(east, north, color=COLOURS[key], lw=1.2, label=METHODS[key].title)
    left.set_aspect("equal", adjustable="datalim")
    dress(left, "one run, paper noise, weave", "east [m]", "north [m]")
    left.legend(fontsize=9, frameon=False)
    for axes, row in zip(right, (POOLED, "fine_process_weave"), strict=True):
        if row in study.results:
            _errors(axes, study, row)
    return figure


def _errors(axes: Axes, study: Study, row: str) -> None:
    results = study.results[row]
    for key, colour in COLOURS.items():
        if key in results:
            rms = np.sqrt(results[key].squares.mean(axis=0))
            times = SAMPLE * np.arange(1, len(rms) + 1)
            axes.plot(times, rms, color=colour, lw=1.4, ls="--" if key == "oracle" else "-", label=METHODS[key].title)
    if row in study.bounds:
        axes.plot(BOUND_TIMES, study.bounds[row], color=BOUND, ls=":", lw=2.0, label="posterior bound")
    axes.set_yscale("log")
    name = "paper" if row == POOLED else "fine"
    dress(axes, f"{len(results['dr'].final)} runs, {name} noise, weave", "time [s]", "rms error of the position [m]")
    axes.legend(fontsize=9, frameon=False)


def leader(seed: int) -> Figure:
    """Figure 3: the leader straight and on a curve: truth, its own estimate, and its pose in IIRU's state."""
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    for axes, scene in zip(figure.subplots(1, 2), ("straight", "curve"), strict=True):
        run = simulate(Conditions(scene=scene, mode="sensor", noise="paper"), seed, 0)
        axes.plot(run.leader[:, 1], run.leader[:, 0], color=TRUTH, lw=2.0, label="truth")
        axes.plot(run.leader_own[:, 1], run.leader_own[:, 0], color=COLOURS["dekf"], label="its own estimate")
        predicted = _track("iiru", run, of_leader=True)
        axes.plot(predicted[:, 1], predicted[:, 0], color=COLOURS["iiru"], ls="--", label="predicted by the follower")
        axes.set_aspect("equal", adjustable="datalim")
        dress(axes, f"leader, {scene}, paper noise", "east [m]", "north [m]")
        axes.legend(fontsize=9, frameon=False)
    return figure


def delay(study: Study) -> Figure:
    """The delay threshold: accuracy, CPU and memory over the delay of packets."""
    figure = Figure(figsize=(14.0, 5.0), layout="constrained")
    accuracy, turning, cpu, memory = figure.subplots(1, 4)
    keys = ("ekf", "dekf", "iiru", "sc", "rt", "choosing")
    for key in keys:
        for axes, name in ((accuracy, "fine"), (turning, "turning")):
            rows = [study.results.get(f"delay_{name}_{d:g}") for d in DELAYS]
            points = [(d, r[key].rms / r["rt"].rms) for d, r in zip(DELAYS, rows, strict=True) if r is not None]
            axes.plot(*zip(*points, strict=True), "o-", color=COLOURS[key], label=METHODS[key].title)
        rows = [study.results.get(f"delay_fine_{d:g}") for d in DELAYS]
        runs = [(d, r[key]) for d, r in zip(DELAYS, rows, strict=True) if r is not None]
        cpu.plot([d for d, _ in runs], [1e3 * np.median(r.cpu) for _, r in runs], "o-", color=COLOURS[key])
        memory.plot([d for d, _ in runs], [np.median(r.memory) / 1024.0 for _, r in runs], "o-", color=COLOURS[key])
    for axes, title in ((accuracy, "leader steady"), (turning, "leader weaving, noisy odometry")):
        axes.axhline(1.1, color=BOUND, ls=":", label="10 % worse")
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)))
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        dress(axes, title, "delay of packets [s]", "rms over that of SC-RT")
    dress(cpu, "time of computing", "delay of packets [s]", "CPU for 1000 s [ms]")
    dress(memory, "memory", "delay of packets [s]", "state of the filter [kB]")
    for axes in (accuracy, turning, cpu, memory):
        axes.set_xscale("log")
        axes.set_xticks((*DELAYS[::2], 60.0), [f"{d:g}" for d in (*DELAYS[::2], 60.0)])
    accuracy.legend(fontsize=9, frameon=False)
    return figure


def loss(study: Study) -> Figure:
    """Rms over the share of packets lost, in three situations."""
    figure = Figure(figsize=(13.0, 4.8), layout="constrained")
    titles = {
        "fine": "fine noise, leader steady",
        "paper": "paper noise, leader steady",
        "turning": "fine, leader weaving",
    }
    for axes, (name, title) in zip(figure.subplots(1, 3), titles.items(), strict=True):
        rows = [study.results.get(f"loss_{name}_{share:.0%}") for share in LOSSES]
        for key in ("dekf", "iiru", "sc", "sc_plain", "rt", "choosing"):
            points = [(100.0 * share, r[key].rms) for share, r in zip(LOSSES, rows, strict=True) if r is not None]
            if points:
                style = "s:" if key == "sc_plain" else "o-"
                colour = COLOURS[key.removesuffix("_plain")]
                axes.plot(*zip(*points, strict=True), style, color=colour, label=METHODS[key].title)
        axes.set_ylim(bottom=0.0)
        dress(axes, title, "packets lost [%]", "rms error of the position [m]")
        if axes.lines:
            axes.legend(fontsize=9, frameon=False)
    return figure


def threshold(study: Study, limit: float = 1.1) -> float:
    """The delay [s] at which ignoring it costs `limit` times SC-RT's rms, at fine noise; NaN if it never does."""
    rows = [study.results.get(f"delay_fine_{d:g}") for d in DELAYS]
    if any(r is None for r in rows):
        return math.nan
    ratios = np.array([r["ekf"].rms / r["rt"].rms for r in rows if r is not None])
    above = np.flatnonzero(ratios > limit)
    if not len(above):
        return math.nan
    k = int(above[0])
    return DELAYS[0] if k == 0 else float(np.interp(limit, ratios[k - 1 : k + 1], DELAYS[k - 1 : k + 1]))


def _shuffled(seed: int) -> tuple[Run, int]:
    """A run with packets out of order, and the number of a pulse shortly before."""
    for number in range(100):
        run = simulate(Conditions(noise="paper", delay_deviation=6.0), seed, number)
        order = [event.number for event in run.events if isinstance(event, Packet)]
        late = [n for k, n in enumerate(order) if n < max(order[:k], default=-1)]
        if late:
            return run, max(0, late[0] - 1)
    raise AssertionError("no packet out of order in 100 runs")


def _track(key: str, run: Run, of_leader: bool = False) -> Array:
    """Estimated places (k, 2) along a run, of the follower or of the leader in the follower's state."""
    method, places, n = METHODS[key].make(run), [], 0
    for k, (speed, yaw_rate) in enumerate(run.odometry.tolist()):
        while n < len(run.events):
            event = run.events[n]
            time = event.received if isinstance(event, Packet) else event.detected
            if time > (k + 1) * STEP:
                break
            method.advance(max(method.time, time), speed, yaw_rate)
            deliver(method, event)
            n += 1
        method.advance((k + 1) * STEP, speed, yaw_rate)
        if not of_leader:
            places.append(method.belief.mean[:2])
        elif (known := method.leader) is not None:
            places.append(known[1].copy())
    return np.array(places)
