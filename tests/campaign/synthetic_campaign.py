"""A campaign without trials: two variants in the same 60 conditions, with failures where they are known."""

import math

import numpy as np

from auvsim.analysis.statistics import wilson
from auvsim.campaign.columns import layout
from auvsim.campaign.report import Content
from auvsim.campaign.statistics import Difference, Nees, Rate

VARIANTS = ("careful", "<b>bold</b>")  # a name may hold anything
TRIALS = 60
DRAWN = ("dock.heading_deg", "current.speed", "current.direction_deg")


def row(variant: int, trial: int) -> dict:
    """One trial. The second variant aborts in strong currents; each eleventh of it raises an error."""
    rng = np.random.default_rng(trial)
    heading, speed, direction = rng.uniform(-180.0, 180.0), rng.uniform(0.0, 0.5), rng.uniform(-180.0, 180.0)
    failure = None
    if variant == 1:
        failure = "error" if trial % 11 == 5 else "aborted" if speed > 0.4 else None
    says = {"aborted": "position too uncertain", "error": "cannot </script><script>alert(1)</script>"}
    failed = failure is not None
    missing = failure == "error"
    return {
        "variant": VARIANTS[variant],
        "trial": trial,
        "docked": not failed,
        "docked_first": not failed and trial % 5 != 0,
        "docked_aligned": not failed and trial % 5 != 1,
        "attempts": 0 if missing else 3 if failed else 1 + (trial % 5 == 0),
        "failure": failure,
        "failure_text": says.get(failure),
        "error_type": "ValueError" if missing else None,
        "error_message": says["error"] if missing else None,
        "traceback": "Traceback (most recent call last):\n  File <stdin>" if missing else None,
        "miss_distance": None if missing else 0.1 * (1.0 + variant) * math.exp(rng.normal(0.0, 0.5)),
        "position_rms": None if missing else 0.3 + 0.1 * variant,
        "position_rms_approach": None if missing else 0.2,
        "nees_per_dof": None if missing else float(rng.chisquare(20) / 20),
        "contact_impulse": None if missing else float(rng.uniform(0.0, 20.0)),
        "time": None if missing else 300.0 + trial,
        "wall_time": 0.5,
        "cpu_time": 0.25,
        "real_time_factor": None if missing else 600.0,
        "command": f"auvsim dock careful.yaml --seed 3 --trial {trial}",
        "log": f"logs/{trial} 100%.nc" if failed and not missing else None,
        "replay": "replays/careful-7/docking.mp4" if (variant, trial) == (0, 7) else None,
        "dock.heading_deg": heading,
        "current.speed": speed,
        "current.direction_deg": direction,
    }


def rows() -> list[dict]:
    """All trials."""
    return [row(variant, trial) for variant in (0, 1) for trial in range(TRIALS)]


def rates(table: list[dict], variants: tuple[str, ...]) -> list[Rate]:
    """How often each variant docked."""
    found = []
    for name in variants:
        for quantity in ("docked", "docked_first", "docked_aligned"):
            done = [r[quantity] for r in table if r["variant"] == name]
            low, high = wilson(sum(done), len(done))
            found.append(
                Rate(variant=name, quantity=quantity, successes=sum(done), trials=len(done), low=low, high=high)
            )
    return found


def content(**changes) -> Content:
    """The campaign as the report takes it."""
    table, variants = changes.get("rows", rows()), changes.get("variants", VARIANTS)
    difference = {"variant": VARIANTS[1], "value": -0.2, "low": -0.3, "high": -0.1, "pairs": TRIALS}
    fields = {
        "name": "synthetic & small",
        "variants": VARIANTS,
        "trials": TRIALS,
        "seed": 3,
        "state": {"engine": "processes", "jobs": 2, "versions": {"auvsim": "0.1.0"}, "wall_time": 61.0},
        "files": ("plan.yaml", "table.csv"),
        "drawn": DRAWN,
        "layout": layout(("docking",)),
        "rows": table,
        "rates": rates(table, variants),
        "differences": [Difference(quantity="docked", **difference)],
        "nees": [Nees(variant=VARIANTS[0], phase="all", mean=1.02, low=0.9, high=1.1, trials=TRIALS)],
    }
    return Content(**(fields | changes))
