"""Tables as a user's vehicle would write them: a synthetic record as columns, at chosen rates, units and signs."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from auvsim.identification.records import MEASURED, Record
from auvsim.identification.simulated import Kind, Vessel, simulate
from auvsim.physics.planar_fit import fit_planar_model

TRUE = fit_planar_model("remus100", 1.5).parameters
SHAFT = fit_planar_model("remus100", 1.5).shaft_speed


def synthetic(seed: int = 1, duration: float = 60.0, kind: Kind = "multisine") -> Record:
    """A run of the condensed vehicle, everything measured at 10 Hz."""
    vessel = Vessel(parameters=TRUE, shaft_speed=SHAFT, surge=1.5, intervals=(0.1,) * 8)
    return simulate(vessel, kind, seed, duration).record


def columns(record: Record) -> dict[str, np.ndarray]:
    """Its columns with the headers a careful user gives them."""
    measured = dict(zip(MEASURED, record.measured.T, strict=True))
    return {
        "time [s]": record.times,
        "rudder [deg]": np.degrees(record.inputs[:, 0]),
        "n [rpm]": record.inputs[:, 1] * 30.0 / np.pi,
        "heading [deg]": np.degrees(measured["heading"]) % 360.0,
        "yaw_rate [deg/s]": np.degrees(measured["yaw_rate"]),
        "surge [m/s]": measured["surge"],
        "sway [m/s]": measured["sway"],
        "dvl_u [cm/s]": 100.0 * measured["ground_surge"],
        "dvl_v [cm/s]": 100.0 * measured["ground_sway"],
        "north [m]": measured["north"],
        "east [m]": measured["east"],
    }


def every(values: np.ndarray, step: int, first: int = 0) -> np.ndarray:
    """The same with NaN in all rows but every `step`-th."""
    padded = np.full(len(values), np.nan)
    padded[first::step] = values[first::step]
    return padded


def write(path: Path, table: Mapping[str, Iterable], delimiter: str = ",") -> Path:
    """A CSV file of columns; NaN becomes an empty cell."""
    rows = zip(*table.values(), strict=True)
    lines = [delimiter.join(table)]
    lines += [delimiter.join("" if value != value else _text(value) for value in row) for row in rows]
    path.write_text("# a comment\n" + "\n".join(lines) + "\n")
    return path


def _text(value: object) -> str:
    return value if isinstance(value, str) else repr(float(value))  # pyright: ignore[reportArgumentType]
