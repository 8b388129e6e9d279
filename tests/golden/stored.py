"""The part of each golden log that is kept in `logs/`; `python -m tests.golden.stored` runs the cases and writes it."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from .cases import CASES, HERE, run
from .compare import Contents, load

# Every how many rows of a variable are kept.
KEPT = {
    "truth/time": 20,
    "truth/position": 20,
    "truth/attitude": 20,
    "truth/nu": 20,
    "estimate/time": 4,
    "estimate/position": 4,
    "estimate/heading": 4,
    "estimate/velocity": 4,
    "estimate/current": 4,
    "estimate/refused": 1,
    "mission/phase": 1,
    "mission/attempt": 1,
    "mission/heading_setpoint": 20,
    "command/rudder": 20,
    "command/elevator": 20,
    "command/shaft_speed": 20,
    "sensors/compass/value": 40,
    "sensors/usbl/received": 1,
    "sensors/usbl/value": 1,
    "sensors/usbl/outlier": 1,
    "sensors/dvl/value": 10,
    "sensors/gyro/value": 20,
    "contact/impulse": 20,
    "event/time": 1,
    "event/kind": 1,
}
FINS = "truth/fins"  # of each twentieth truth
VARIANCES = "estimate/variances"  # of the planar states, of each fourth covariance
PLANAR = 8  # planar states, before those of errors


def part(contents: Contents) -> dict[str, Any]:
    """What is kept of a log: its vehicle's groups by their names below it, and the events."""
    prefix = "vehicles/remus100/"
    whole = {path.removeprefix(prefix): value for path, value in contents.items()}
    kept = {path: whole[path][::step] for path, step in KEPT.items() if path in whole}
    kept[FINS] = np.ascontiguousarray(whole["truth/actuators"][::20, :-1])
    kept["event/kind"] = kept["event/kind"].astype(str)  # objects would be pickled
    return kept | {VARIANCES: np.diagonal(whole["estimate/covariance"][::4], axis1=1, axis2=2)[:, :PLANAR]}


def read(name: str) -> dict[str, Any]:
    """What is kept of a case."""
    with np.load(HERE / "logs" / f"{name}.npz") as file:
        return dict(file)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for name, case in CASES.items():
            run(case, Path(folder, "log.nc"))
            np.savez_compressed(HERE / "logs" / f"{name}.npz", **part(load(Path(folder, "log.nc"))))
