"""Gyro, DVL and ranges in the docking filter: what they show, the start by ranges, and what they are worth."""

import math
from typing import Any

import numpy as np
import pytest

from estimators.core.consistency import interval
from estimators.core.history import Node
from estimators.core.types import Measurement
from estimators.docking import range_start
from estimators.docking.aids import BOTTOM, GYRO, RANGE, WATER, Aids
from estimators.docking.augmented import AugmentedFilter
from estimators.docking.models import PlanarModels
from estimators.docking.noise import Bias, DockingNoise
from estimators.docking.sensors import COMPASS
from estimators.planar.model import PRESTERO

AIDS = Aids(gyro=True, dvl=True, ranges={"a": (0.6, -0.1), "b": (0.0, 0.0)})
BIASES = {
    "compass": Bias(0.01), "gyro": Bias(1e-4), "dvl_surge": Bias(0.004), "dvl_sway": Bias(0.008),
    "range_a": Bias(0.1), "range_scale_a": Bias(1e-3),
}  # fmt: skip
BEACONS = ((70.0, 15.0, 18.0), (-50.0, 60.0, 18.0), (-25.0, -75.0, 18.0))


def measurement(kind: str, value: Any, sigma: float, stamp: float, source: str = "", **more: Any) -> Measurement:
    value = np.atleast_1d(np.array(value, dtype=float))
    covariance = sigma**2 * np.eye(value.size)
    return Measurement(
        kind=kind, value=value, covariance=covariance, stamp=stamp, received=stamp, source=source, **more
    )


def test_what_each_shows():
    """By hand, at a lopsided state with every error there is; and derivatives by central differences."""
    models = PlanarModels(PRESTERO, DockingNoise(biases=BIASES), aids=AIDS)
    x = np.array([-30.0, 12.0, 0.7, 1.3, -0.2, 0.05, 0.15, -0.1, 0.02, 1e-3, 0.01, -0.03, 0.4, 0.002])
    c, s = math.cos(0.7), math.sin(0.7)
    over_ground = (1.3 + c * 0.15 + s * -0.1 + 0.01, -0.2 - s * 0.15 + c * -0.1 - 0.03)
    north, east = -30.0 + c * 0.6 + s * 0.1, 12.0 + s * 0.6 - c * 0.1
    away = math.dist((70.0, 15.0, 18.0), (north, east, 0.0))
    expected = {
        GYRO: (0.051,), BOTTOM: over_ground, WATER: (1.3 + 0.01, -0.2 - 0.03),
        (RANGE, "a"): (1.002 * away + 0.4,), (RANGE, "b"): (math.dist((70.0, 15.0, 18.0), (-30.0, 12.0, 0.0)),),
    }  # fmt: skip
    assert models.aids.keys() == expected.keys()
    for key, value in expected.items():
        parameters = BEACONS[0] if RANGE in key else ()
        m = measurement(key if isinstance(key, str) else RANGE, value, 0.1, 0.0, parameters=parameters)
        model = models.aids[key]
        assert model.evaluate(x, m) == pytest.approx(value, rel=1e-12)
        steps = 1e-6 * np.eye(x.size)
        numeric = np.array([(model.evaluate(x + h, m) - model.evaluate(x - h, m)) / 2e-6 for h in steps]).T
        assert model.jacobian(x, m) == pytest.approx(numeric, abs=1e-6)


def nodes(place: np.ndarray, seed: int, beacons: int = 3, current: tuple[float, float] = (0.0, 0.0)) -> list[Node]:
    """Twelve seconds on a straight course at the steady surge, with ranges of 0.2 m every 2 s and a compass."""
    noise, found = np.random.default_rng(seed), []
    surge, heading, shaft = 1.0, 0.6, 100.0
    models = PlanarModels(PRESTERO, DockingNoise())
    surge = models._mean(heading, Node(0.0, (0.0, shaft), [], True))[3]
    velocity = surge * np.array((math.cos(heading), math.sin(heading))) + current
    for k in range(25):
        t = 0.5 * k
        at = place - velocity * (12.0 - t)
        seen = [measurement(COMPASS, heading, 0.01, t)]
        if k % 4 == 0:
            for name, beacon in list(zip("abc", BEACONS, strict=True))[:beacons]:
                value = math.dist(beacon, (*at, 0.0)) + 0.2 * noise.normal()
                seen.append(measurement(RANGE, value, 0.2, t, name, parameters=beacon))
        found.append(Node(t, (0.0, shaft), seen, is_grid=True))
    return found


def test_a_start_by_ranges_is_consistent():
    """NEES of the place over 60 runs from places all round, with a current as assumed; in its 99 % interval."""
    noise = DockingNoise(initial_current=0.2)
    models = PlanarModels(PRESTERO, noise, aids=Aids(ranges=dict.fromkeys("abc", (0.0, 0.0))))
    values = []
    for seed in range(60):
        generator = np.random.default_rng(1000 + seed)
        angle = generator.uniform(0.0, math.tau)
        place = generator.uniform(40.0, 250.0) * np.array((math.cos(angle), math.sin(angle)))
        given = nodes(place, seed, current=tuple(0.2 * generator.normal(size=2)))
        started = models.start(given, len(given) - 1)
        assert started is not None
        belief, used = started
        assert [m.kind for m in used] == [COMPASS, RANGE, RANGE, RANGE]
        error = belief.mean[:2] - place
        values.append(error @ np.linalg.solve(belief.covariance[:2, :2], error))
    low, high = interval(2, 60, 0.99)
    assert low < np.mean(values) < high


def test_constant_errors_of_ranges_are_in_a_start():
    """What a range shows too much has moved the place: their covariance says by how much, and in which direction."""
    sources = dict.fromkeys("abc", (0.0, 0.0))
    place, given = np.array((120.0, -40.0)), None
    exact = PlanarModels(PRESTERO, DockingNoise(), aids=Aids(ranges=sources))
    biased = PlanarModels(PRESTERO, DockingNoise(biases={"range_b": Bias(2.0)}), aids=Aids(ranges=sources))
    given = nodes(place, seed=1)
    (one, _), (other, _) = (models.start(given, 24) or pytest.fail("no start") for models in (exact, biased))
    shift = 1.0  # [m]
    for node in given:
        node.measurements = [
            measurement(RANGE, m.value + shift, 0.2, m.stamp, m.source, parameters=m.parameters)
            if m.source == "b" else m for m in node.measurements
        ]  # fmt: skip
    moved, _ = exact.start(given, 24) or pytest.fail("no start")
    change = moved.mean[:2] - one.mean[:2]
    gain = -other.covariance[:2, 8] / 2.0**2  # of the place by the error
    # The belief moves against its own bias state: a range that is 1 m long is explained by either.
    assert change == pytest.approx(gain * shift, abs=0.02 * float(np.linalg.norm(change)) + 0.02)
    grown = other.covariance[:2, :2] - one.covariance[:2, :2]
    assert grown == pytest.approx(4.0 * np.outer(gain, gain), rel=1e-6, abs=1e-9)


def test_one_or_two_places_that_fit_are_no_start():
    """One beacon: a circle; two, and no motion in between: two places."""
    models = PlanarModels(PRESTERO, DockingNoise(), aids=Aids(ranges=dict.fromkeys("abc", (0.0, 0.0))))
    place = np.array((90.0, 110.0))
    assert models.start(nodes(place, 0, beacons=1), 24) is None
    still = nodes(place, 0, beacons=2)[-1:]
    assert range_start.place(range_start.heard(still, np.zeros(2), RANGE), 0.3) is None
    still = nodes(place, 0)[-1:]
    found = range_start.place(range_start.heard(still, np.zeros(2), RANGE), 0.3)
    assert found is not None
    assert math.dist(found.position, place) < 3.0


def test_a_wrong_range_is_refused_and_its_source_recovers():
    """One range 30 m off is an outlier that moves nothing; a source of its own is named."""
    sources = dict.fromkeys("abc", (0.0, 0.0))
    filter_ = AugmentedFilter(PRESTERO, DockingNoise(current=1e-6), aids=Aids(ranges=sources))
    given = nodes(np.array((120.0, -40.0)), 2)
    state = filter_.start(given, 24)
    assert state is not None
    x = state.belief.mean
    value = math.dist(BEACONS[1], (*x[:2], 0.0))
    wrong = measurement(RANGE, value + 30.0, 0.2, 12.0, "b", parameters=BEACONS[1])
    after = filter_.correct(state, 12.0, [wrong])
    assert after.belief is state.belief
    assert after.verdicts[-1][1] == "outlier"
    good = measurement(RANGE, value, 0.2, 12.0, "b", parameters=BEACONS[1])
    assert filter_.correct(after, 12.0, [good]).verdicts[-1][1] == ""
