"""Parameter files: whole and bit for bit, found by name or path, and assumed by a trial's estimator."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.base import plugins
from auvsim.base.errors import InputError
from auvsim.navigation.estimate import PLANAR_STATES
from auvsim.physics import planar_sets
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.physics.planar_sets import PlanarSet, Source, coefficients
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import Simulation
from auvsim.vehicles import model_files
from estimators.planar.model import PARAMETER_NAMES, PRESTERO, PlanarParameters


def some_set(parameters: PlanarParameters = PRESTERO, **changes: Any) -> PlanarSet:
    """A set of the shipped vehicle, of two fitted parameters, one of them open on a side."""
    values: dict[str, Any] = {
        "vehicle": "remus100", "speed": 1.4, "method": "segments", "start": "condense at 1.4 m/s", "version": "0.1.0",
        "sources": (Source(file="zigzag.nc", sha256="0" * 64),), "verdict": ("better: than its start", "1 of 14"),
        "parameters": coefficients(parameters, {"X_uu": (-4.0, -3.0), "N_rr": (None, -1e-17)}),
        "noise": planar_sets.Noise(north=1e-7, east=0.1 + 0.2, heading=0.0, surge=1.0, sway=1e-300, yaw_rate=1e-5),
    }  # fmt: skip
    return PlanarSet(**{**values, **changes})


def test_a_set_is_read_as_it_was_written_bit_for_bit(tmp_path: Path) -> None:
    """Random mantissas and exponents over 22 decades: every bit of every number comes back."""
    rng = np.random.default_rng(0)
    numbers = rng.standard_normal(len(PARAMETER_NAMES)) * 10.0 ** rng.uniform(-11, 11, len(PARAMETER_NAMES))
    values = dict(zip(PARAMETER_NAMES, numbers.tolist(), strict=True))
    values |= {name: abs(values[name]) for name in ("m", "I_z")}  # a body has inertia, and added mass adds to it
    values |= {name: -abs(values[name]) for name in ("X_ud", "Y_vd", "N_rd")}
    parameters = PlanarParameters(**values)
    written, path = some_set(parameters), tmp_path / "mine.yaml"
    planar_sets.write(written, path)
    found = planar_sets.read(path)
    assert found == written
    assert found.planar().vector().tobytes() == parameters.vector().tobytes()
    assert planar_sets.load(str(path), "remus100") == parameters
    planar_sets.write(found, tmp_path / "again.yaml")
    assert (tmp_path / "again.yaml").read_bytes() == path.read_bytes()


def test_every_parameter_has_its_unit() -> None:
    """Each term of the model is a force or a moment: its unit by that of what it multiplies."""
    assert planar_sets.UNITS.keys() == set(PARAMETER_NAMES)
    # Powers of (kg, m, s) of X, Y [N] or N [N m] divided by those of the motion, a radian being 1.
    velocity, rate, second = np.array([0, 1, -1]), np.array([0, 0, -1]), np.array([0, 0, 0])
    factors = {"u": velocity, "v": velocity, "r": rate, "d": second, "n": rate}
    force = {"X": np.array([1, 1, -2]), "Y": np.array([1, 1, -2]), "N": np.array([1, 2, -2])}
    for name, unit in planar_sets.UNITS.items():
        axis, _, motion = name.partition("_")
        if name in ("m", "x_g", "I_z", "X_prop"):
            continue
        powers = force[axis].copy()
        if motion in ("ud", "vd", "rd"):
            powers -= factors[motion[0]] + [0, 0, -1]
        else:
            for letter in motion:
                powers -= factors[letter]
            if motion == "dd":  # forces of fins grow with the speed squared besides
                powers -= 2 * velocity
        assert tuple(powers) == _powers(unit), name


def _powers(unit: str) -> tuple[int, int, int]:
    """(kg, m, s) of a unit such as `kg m2/s`."""
    above, _, below = unit.partition("/")
    counts = {"kg": 0, "m": 0, "s": 0}
    for text, sign in ((above, 1), (below, -1)):
        for part in text.split():
            symbol = part.rstrip("0123456789")
            counts[symbol] += sign * int(part[len(symbol) :] or 1)
    return counts["kg"], counts["m"], counts["s"]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("X_uu:", "X_uuu:"), "parameters.X_uuu: no such parameter"),
        (("unit: kg/m,", "unit: N,"), "it must be in 'kg/m'"),
        (("format: 1", "format: 2"), "format"),
        (("speed: 1.4", "speed: fast"), "mine.yaml:3: speed"),
        (("  I_z: {value: 3.45, unit: kg m2}\n", ""), "I_z must be given"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path: Path, change: tuple[str, str], text: str) -> None:
    """Each with the file and the key at fault."""
    path = tmp_path / "mine.yaml"
    planar_sets.write(some_set(), path)
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError, match=r"mine\.yaml") as caught:
        planar_sets.read(path)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_names_are_found_beside_the_vehicle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shipped vehicle's sets by name; an error lists those that exist; another vehicle's set is refused."""
    monkeypatch.setattr(model_files, "models_folder", lambda: tmp_path)
    home = planar_sets.folder("remus100")
    home.mkdir(parents=True)
    planar_sets.write(some_set(), home / "lake.yaml")
    assert planar_sets.load("lake", "remus100") == PRESTERO
    with pytest.raises(InputError, match=r"no planar model 'sea'; there are condense, lake, the path of a \.yaml"):
        planar_sets.load("sea", "remus100")
    with pytest.raises(InputError, match="auvsim identify"):
        planar_sets.load(str(tmp_path / "none.yaml"), "remus100")
    with pytest.raises(InputError, match="parameters of 'remus100', not of 'lauv'"):
        planar_sets.load(str(home / "lake.yaml"), "lauv")
    assert planar_sets.folder(str(tmp_path / "own" / "lauv.xml")) == tmp_path / "own" / "planar"


def test_a_trial_believes_the_set_it_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimator's factory is handed the file's parameters; start and shaft speed stay those of the vehicle."""
    handed: list[PlanarParameters] = []

    def factory(setup: Any) -> Any:
        handed.append(setup.parameters)
        return SimpleNamespace(update=print, reset=print, states=PLANAR_STATES)

    find = plugins.find
    monkeypatch.setattr(plugins, "find", lambda what, *rest: factory if what == "estimator" else find(what, *rest))
    wrong = replace(fit_planar_model("remus100", 1.0).parameters, X_uu=-1.2345678901234567)
    path = tmp_path / "wrong.yaml"
    planar_sets.write(some_set(wrong), path)
    speeds = []
    for model in ("condense", str(path)):
        plan = sampling.merge(sampling.default_plan(), {"estimator": {"model": model}})
        simulation = Simulation(scenario.parse(sampling.draw(plan, 0)), 0)
        speeds.append(simulation.agents[0].commands.shaft_speed)
    assert handed == [fit_planar_model("remus100", 1.0).parameters, wrong]
    assert speeds[0] == speeds[1]


def test_the_shipped_set_is_of_its_vehicle_and_better_than_its_start():
    """Masses are the vehicle's; what was held out it predicts better than the model fitted to MuJoCo's forces."""
    found = planar_sets.read(planar_sets.find("identified", "remus100_x"))
    assert planar_sets.load("identified", "remus100_x").m == pytest.approx(31.03, abs=0.01)
    assert found.hold_out is not None
    assert found.hold_out.share < 0.5 * found.hold_out.start_share
