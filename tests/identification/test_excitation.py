"""Information against finite differences, the design against every standard manoeuvre, its limits and its replay."""

import math

import casadi as ca
import numpy as np
import pytest
from pydantic import ValidationError

from auvsim.base.errors import InputError
from auvsim.identification import excitation
from auvsim.identification.excitation import Bench, Excitation
from auvsim.identification.fit import DEFAULT_FREE
from auvsim.identification.information import STEP, Experiment, Progressed
from auvsim.missions.manoeuvres.laws import Steering
from auvsim.missions.manoeuvres.settings import OptimalSettings
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.simulation.sensor_settings import SensorSettings
from estimators.planar.model import PARAMETER_NAMES, accelerations

DEG = math.pi / 180.0
LIMIT = 15.0 * DEG
# Short and coarse, so that it is quick: what a long one reaches is in the study below.
SHORT = OptimalSettings(duration=80.0, approach=10.0, dwell=3.0, room=70.0)


@pytest.fixture(scope="module")
def bench() -> Bench:
    """The shipped vehicle near 1.5 m/s with the default sensors."""
    model = fit_planar_model("remus100", 1.5)
    experiment = Experiment(model.parameters, SensorSettings())
    return Bench(experiment=experiment, shaft_speed=model.shaft_speed_for, rudder_limit=LIMIT)


@pytest.fixture(scope="module")
def designed(bench: Bench) -> Excitation:
    """A short design."""
    return excitation.design(SHORT, bench, seed=3)


def shown(parameters: np.ndarray, first: np.ndarray, errors: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """What heading, water track, gyro and bottom track show: an own integration, an own model of the sensors.

    Args:
        parameters: (m, 30), of m vehicles at once.
        first: Heading, surge, sway, yaw rate (m, 4).
        errors: Current north, east, gyro, compass, misalignment, scale (m, 6).
        inputs: (n, 2).

    Returns:
        (m, n, 6).
    """
    count = len(parameters)
    nu, u, p = ca.SX.sym("nu", 3), ca.SX.sym("u", 2), ca.SX.sym("p", len(PARAMETER_NAMES))
    function = ca.Function("l", [nu, u, p], [accelerations(nu, u[0], u[1], p)]).map(count)

    def slope(x: np.ndarray, given: np.ndarray) -> np.ndarray:
        l = function(x[:, 1:].T, np.tile(given[:, None], count), parameters.T).full().T
        return np.column_stack([x[:, 3], l])

    x, rows = first.copy(), []
    north, east, gyro, compass, misalignment, scale = errors.T
    turn = (1.0 + scale) * np.exp(-1j * misalignment)
    for given in inputs:
        k1 = slope(x, given)
        k2 = slope(x + STEP / 2 * k1, given)
        k3 = slope(x + STEP / 2 * k2, given)
        k4 = slope(x + STEP * k3, given)
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        water = turn * (x[:, 1] + 1j * x[:, 2])
        ground = water + turn * (north + 1j * east) * np.exp(-1j * x[:, 0])
        rows.append([x[:, 0] + compass, water.real, water.imag, x[:, 3] + gyro, ground.real, ground.imag])
    return np.array(rows).transpose(2, 0, 1)


def test_information_against_finite_differences(bench: Bench) -> None:
    """The same matrix from central differences of an independent simulation, biases and first state eliminated."""
    time = STEP * np.arange(150)
    inputs = np.column_stack([LIMIT * np.sin(0.9 * time) * (time > 2.0), np.where(time > 8.0, 110.0, 80.0)])
    experiment, k = bench.experiment, len(DEFAULT_FREE)
    steps = 1e-4 * np.vstack([np.eye(k + 10), -np.eye(k + 10)])
    parameters = np.tile(experiment.parameters.vector(), (len(steps), 1))
    parameters[:, [PARAMETER_NAMES.index(name) for name in DEFAULT_FREE]] *= 1.0 + steps[:, :k]
    seen = shown(parameters, np.array([0.0, 1.5, 0.0, 0.0]) + steps[:, k : k + 4], steps[:, k + 4 :], inputs)
    columns = (seen[: k + 10] - seen[k + 10 :]) / 2e-4  # (k + 10, n, 6)
    sensors = SensorSettings()
    noises = [1.0 * DEG, 0.02, 0.02, 0.005 * DEG * math.sqrt(10.0), 0.01, 0.01]
    rates = [10.0, 5.0, 5.0, 10.0, 5.0, 5.0]
    weights = np.sqrt(STEP * np.array(rates)) / noises
    J = (columns * weights).reshape(k + 10, -1).T
    prior = [1.0, 1.0, 1.0, 0.3, 1.0, 1.0, sensors.gyro.bias_deg * DEG, 0.5 * DEG, 0.3 * DEG, 0.002]
    whole = J.T @ J
    rest = whole[k:, k:] + np.diag(np.array(prior) ** -2.0)
    expected = whole[:k, :k] - whole[:k, k:] @ np.linalg.solve(rest, whole[k:, :k]) + np.eye(k)
    found = experiment.information(experiment.run(experiment.start(1.5), inputs))
    # Differences of 1e-4 are good to 1e-8 of the second derivative and 1e-11 of rounding; the elimination takes away
    # nearly all of some entries, which costs some digits more.
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=2e-5)
    assert np.linalg.slogdet(found)[1] == pytest.approx(np.linalg.slogdet(expected)[1], abs=1e-3)


def test_information_adds_up(bench: Bench) -> None:
    """In parts or at once, the same; and more of it never tells less."""
    inputs = np.column_stack([LIMIT * np.sign(np.sin(0.5 * STEP * np.arange(400))), np.full(400, 95.0)])
    experiment = bench.experiment
    whole = experiment.run(experiment.start(1.5), inputs)
    parts: Progressed = experiment.start(1.5)
    before = -math.inf
    for part in np.split(inputs, 8):
        parts = experiment.run(parts, part)
        assert experiment.log_det(parts) > before
        before = experiment.log_det(parts)
    np.testing.assert_array_equal(parts.gathered, whole.gathered)
    assert experiment.log_det(experiment.start(1.5)) == 0.0  # what is believed beforehand: 100 % of each


@pytest.mark.parametrize("steps", [True, False])
def test_the_design_tells_more_than_every_standard_manoeuvre(bench: Bench, designed: Excitation, steps: bool) -> None:
    """Of the same length, with and without steps of speed: even of those that leave the room."""
    for name, manoeuvre in excitation.standards(SHORT, bench, steps=steps).items():
        assert manoeuvre.duration == pytest.approx(SHORT.duration)
        assert bench.carry_out(manoeuvre, SHORT).log_det < designed.outcome.log_det, name


def test_the_design_keeps_its_limits(bench: Bench, designed: Excitation) -> None:
    """Rudder, its rate, speeds and room, all of them used; and the table says the same as the history."""
    rudder, speed = designed.history.T
    assert np.abs(rudder).max() == pytest.approx(LIMIT, rel=1e-12)
    rates = np.abs(np.diff(rudder, prepend=0.0)) / STEP
    assert rates.max() == pytest.approx(20.0 * DEG, rel=1e-9)
    assert set(speed) <= {1.0, 1.5, 1.8}
    assert 0.5 * SHORT.room < designed.outcome.reach <= SHORT.room
    steering = Steering(designed.table, limit=LIMIT, rate=1.0 / STEP, course=0.0)
    orders = [steering.order(STEP * tick, 0.0) for tick in range(round(SHORT.duration / STEP))]
    assert all(order.rudder is None for order in orders[:100])
    np.testing.assert_allclose([order.rudder or 0.0 for order in orders[100:]], rudder, atol=1e-12)
    assert [order.speed for order in orders[100:]] == speed.tolist()
    again = bench.carry_out(designed.table, SHORT)
    assert again.log_det == pytest.approx(designed.outcome.log_det, abs=1e-9)
    assert again.reach == pytest.approx(designed.outcome.reach, abs=1e-9)


def test_less_rudder_tells_less(bench: Bench, designed: Excitation) -> None:
    """A design of a third of the rudder and a fifth of its rate keeps to them; with less information."""
    tight = SHORT.model_copy(update={"rudder_deg": 5.0, "rudder_rate_deg": 4.0, "room": 80.0})
    found = excitation.design(tight, bench, seed=3)
    assert np.abs(found.history[:, 0]).max() <= 5.0 * DEG + 1e-12
    assert np.abs(np.diff(found.history[:, 0])).max() <= 4.0 * DEG * STEP + 1e-12
    assert found.outcome.reach <= 80.0
    assert found.outcome.log_det < designed.outcome.log_det


def test_the_same_seed_gives_the_same_design(bench: Bench) -> None:
    """To the last point; progress runs to its end."""
    quick = SHORT.model_copy(update={"duration": 40.0})
    told: list[tuple[float, float]] = []
    first = excitation.design(quick, bench, seed=1, progress=lambda *state: told.append(state))
    assert first.table == excitation.design(quick, bench, seed=1).table
    assert first.table != excitation.design(quick, bench, seed=2).table
    assert all(0.0 <= done <= total for done, total in told)
    assert told == sorted(told)
    assert told[-1][0] == told[-1][1]


def test_what_cannot_be_designed_is_refused(bench: Bench) -> None:
    """One line each: too little room, too much rudder, parameters that are zero, sensors without noise."""
    with pytest.raises(InputError, match="nothing was found that stays within a room of 5 m; the best reaches"):
        excitation.design(SHORT.model_copy(update={"duration": 30.0, "room": 5.0}), bench)
    with pytest.raises(InputError, match="rudder 20 deg is beyond the fins' 15 deg"):
        excitation.design(SHORT.model_copy(update={"rudder_deg": 20.0}), bench)
    with pytest.raises(InputError, match="Y_v is zero"):
        Experiment(bench.experiment.parameters, SensorSettings(), free=("X_uu", "Y_v"))
    silent = SensorSettings.model_validate({"gyro": {"noise_density_deg": 0.0}})
    with pytest.raises(InputError, match="sensors without noise"):
        Experiment(bench.experiment.parameters, silent)
    for wrong in ({"speed_steps": (1.0,)}, {"speed": 3.0}, {"slowest": 1.9}):
        with pytest.raises(ValidationError):
            OptimalSettings(**wrong)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_full_design_halves_what_the_best_standard_leaves(bench: Bench, seed: int) -> None:
    """Five minutes in a room of 150 m: at least twice the information a parameter of any standard manoeuvre."""
    settings = OptimalSettings()
    found = excitation.design(settings, bench, seed=seed)
    best = max(bench.carry_out(m, settings).log_det for m in excitation.standards(settings, bench).values())
    assert found.outcome.reach <= settings.room
    assert math.exp((found.outcome.log_det - best) / len(DEFAULT_FREE)) > 2.0
