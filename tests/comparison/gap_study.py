"""How often the gap sheet is right: vehicles of which one thing is changed, and equal ones, over seeds.

From the checkout: `python tests/comparison/gap_study.py --seeds 10 --first 31`. What a change is to the planar model is
found by condensing the changed vehicle; it stands beside each named coefficient.
"""

import argparse
import dataclasses
import shutil
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from auvsim.comparison import gap
from auvsim.data import log as logs
from auvsim.identification import readers
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.simulation import scenario
from auvsim.simulation.run import run
from auvsim.vehicles import model_files

# What is changed: the number's place in the file, and the coefficients of the planar model that it is.
CHANGES = {
    "equal": ("", ""),
    "drag": ('hull_quadratic_damping" data="5.84 ', "X_uu X_nn X_nu"),
    "lift": ('hull_body_lift" data="28.6"', "Y_uv N_uv"),
    "cross-flow": ('hull_cross_flow_drag" data="1.198"', "Y_vv Y_rr N_vv N_rr"),
    "rudder": ('rudder_upper_lift_slope" data="0.5"', "Y_dd N_dd"),
    "thrust": ('propeller_thrust_coefficients" data="0.4566 ', "X_nn X_nu X_uu"),
}  # fmt: skip


class Case(NamedTuple):
    """One trial of one vehicle against the unchanged model."""

    change: str
    factor: float
    found: gap.Gap
    true: dict[str, float]  # change of each coefficient of the planar model
    seconds: float  # of CPU of the comparison


def sailed(path: Path, model: str, seed: int, duration: float = 110.0) -> None:
    """A multisine with steps of speed in a current."""
    steps = {"speed_steps": [1.2, 1.8, 1.5], "step_time": 25.0}
    settings = {"kind": "multisine", "duration": duration, "approach": 10.0, **steps}
    on = {"enabled": True}
    pinned = {
        "mission": {"kind": "manoeuvre", "manoeuvre": settings},
        "vehicle": {"model": model, "start": {"range": 150.0, "heading_deg": 70.0, "depth": 12.0}},
        "current": {"kind": "uniform", "speed": 0.15, "direction_deg": 100.0},
        "sensors": {"dvl": on, "gyro": on},
    }
    logs.write(run(scenario.parse(pinned), seed=seed), path)


def changed(folder: Path, change: str, factor: float) -> Path:
    """A REMUS-100 of which one number is `factor` times as large."""
    model = folder / "own" / "remus100.xml"
    shutil.copytree(model_files.models_folder() / "remus100", folder / "own", dirs_exist_ok=True)
    text, (place, _) = model.read_text(), CHANGES[change]
    if place:
        assert place in text
        number = place.split('data="')[1].strip('" ')
        new = place.replace(number, repr(float(number) * factor))
        text = text.replace(place, new)
        lower = place.replace("upper", "lower")
        text = text.replace(lower, new.replace("upper", "lower"))
    model.write_text(text)
    return model


def one(change: str, factor: float, seed: int) -> Case:
    """Sails the changed vehicle and holds the unchanged one's model against its log."""
    with tempfile.TemporaryDirectory() as name:
        model = changed(Path(name), change, factor)
        sailed(Path(name) / "trial.nc", str(model), seed)
        readings = readers.read([Path(name) / "trial.nc"])
        begun = time.process_time()
        found = gap.compare(readings.records, "remus100", notes=readings.notes)
        seconds = time.process_time() - begun
        ours, theirs = (dataclasses.asdict(fit_planar_model(v, 1.5).parameters) for v in ("remus100", str(model)))
    true = {key: theirs[key] / ours[key] - 1.0 for key in ours if abs(ours[key]) > 1e-6}
    return Case(change, factor, found, true, seconds)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="The gap sheet on vehicles of which one thing is changed.")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=21)
    parser.add_argument("--changes", nargs="+", default=list(CHANGES))
    parser.add_argument("--factors", nargs="+", type=float, default=[0.7, 1.3])
    options = parser.parse_args()
    cases = []
    for seed in range(options.first, options.first + options.seeds):
        for change in options.changes:
            factor = (
                1.0
                if change == "equal"
                else options.factors[(seed + options.changes.index(change)) % len(options.factors)]
            )
            cases.append(one(change, factor, seed))
            show(seed, cases[-1])
    summary(cases)


def show(seed: int, case: Case) -> None:
    """Prints a case in one line."""
    named = ", ".join(
        f"{e.name} {e.change:+.0%} ({e.low:+.0%} to {e.high:+.0%}, true {case.true.get(e.name, 0.0):+.0%})"
        for e in case.found.explained
    )
    print(f"{seed} {case.change} x{case.factor:g}: {case.found.grade} "
          f"{case.found.errors[case.found.graded]:.1%}: {named or '-'}; {case.seconds:.1f} s", flush=True)  # fmt: skip


def summary(cases: list[Case]) -> None:
    """Prints what came of all."""
    for change in dict.fromkeys(case.change for case in cases):
        own = [case for case in cases if case.change == change]
        right = CHANGES[change][1].split()
        named = [[e.name for e in case.found.explained] for case in own]
        told = sum(any(name in right for name in names) for names in named)
        false = sum(bool(names) and not any(name in right for name in names) for names in named)
        best = sum(case.found.grade == "A" for case in own)
        print(f"{change}: {len(own)} runs, grade A {best}, a right coefficient named {told}, only wrong ones {false}")
    held = [
        e.low <= case.true.get(e.name, 0.0) <= e.high
        for case in cases for e in case.found.explained if e.name in CHANGES[case.change][1].split()[:1]
    ]  # fmt: skip
    if held:
        print(f"intervals of rightly named first coefficients hold the true change in {sum(held)} of {len(held)}")


if __name__ == "__main__":
    main()
