"""Finding estimators, and what the docking navigator makes of readings: averages, lever arms, counts, reset."""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pydantic import TypeAdapter

from auvsim.acoustics.usbl import Usbl, UsblSettings
from auvsim.base.errors import InputError
from auvsim.base.frames import euler_to_quaternion, rotation, wrap
from auvsim.base.randomness import stream
from auvsim.base.reading import Reading
from auvsim.navigation import registry
from auvsim.navigation.docking import DockingNavigator
from auvsim.navigation.estimate import Estimate, estimator_events
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.navigation.settings import AugmentedSettings, EstimatorSettings
from auvsim.physics import planar_fit
from auvsim.physics.truth import StructurePose, Truth
from auvsim.sensors.compass import CompassSettings
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from estimators.core.types import Measurement
from estimators.docking.estimator import UsblFix
from estimators.docking.noise import Bias, DockingNoise
from estimators.docking.usbl import UsblModel

DOCK = StructurePose(north=400.0, east=-300.0, depth=20.0, heading=0.7, pitch=0.05, roll=-0.04)
MOUTH = DOCK.position[:2]
EXACT: dict[str, Any] = {
    "noise_scale": 0.0,
    "outlier_probability": 0.0,
    "dock_heading_bias_deg": 0.0,
    "dock_tilt_bias_deg": 0.0,
    "dock_depth_noise": 0.0,
    "dock_depth_bias": 0.0,
    "jitter": 0.0,
}
NONE = Commands(0.0, 0.0, 0.0)


def build(name: str = "augmented_ekf", usbl: UsblSettings | None = None, rate: float = 10.0, **settings: Any) -> Any:
    """An estimator that assumes the shipped vehicle's planar model, for a dock away from the datum."""
    setup = NavigatorSetup(
        vehicle="auv",
        settings=TypeAdapter(EstimatorSettings).validate_python({"kind": name, **settings}),
        parameters=planar_fit.fit_planar_model("remus100", 1.0).parameters,
        actuation=library.vehicle("remus100").actuation,
        period=0.5,
        rates={"compass": rate},
        usbl=usbl or UsblSettings(),
        dock=DOCK,
    )
    return registry.build(setup)


class Recorder:
    """Stands in for the filter: keeps what each tick is given; its yaw rate can be set."""

    def __init__(self, yaw_rate: float = 0.0) -> None:
        self.ticks: list[SimpleNamespace] = []
        self.resets = 0
        self.filter = SimpleNamespace(noise=DockingNoise())
        self._mean = np.array([1.0, 2.0, 0.3, 1.0, 0.1, yaw_rate, 0.2, -0.1])

    def reset(self) -> None:
        """Counts."""
        self.resets += 1

    def tick(
        self,
        time: float,
        heading: float | None,
        rudder: float,
        shaft_speed: float,
        fixes: Sequence[UsblFix],
        aids: Sequence[Measurement],
    ) -> SimpleNamespace:
        """Keeps its arguments."""
        self.ticks.append(SimpleNamespace(time=time, heading=heading, rudder=rudder, shaft=shaft_speed, fixes=fixes))
        refused = {"outlier": 2, "duplicate": 1}
        return SimpleNamespace(
            mean=self._mean,
            covariance=np.eye(8),
            initialised=True,
            refused=refused,
            reinitialised=0,
            outcomes=(),
        )


def recording(yaw_rate: float = 0.0) -> tuple[DockingNavigator, Recorder]:
    """A docking navigator round a recorder."""
    recorder = Recorder(yaw_rate)
    made: Any = recorder
    return DockingNavigator(made, library.vehicle("remus100").actuation, np.array([100.0, 10.0])), recorder


def compass(time: float, heading: float) -> Reading:
    """A compass reading."""
    return Reading("compass", time, time, np.array([wrap(heading), 0.0, 0.0]))


@pytest.mark.parametrize("name", registry.ESTIMATORS)
def test_named_factories(name: str) -> None:
    """All give estimates that are not initialised before a fix and are after it."""
    navigator = build(name)
    first = navigator.update(0.5, [compass(0.5, 0.1)], (), NONE)
    assert not first.initialised
    packet = Reading("usbl", 0.6, 1.0, np.array([-50.0, 3.0, 0.0, 0.0, 0.0, 0.0, 20.0]))
    second = navigator.update(1.0, [compass(1.0, 0.1), packet], (), NONE)
    assert second.initialised
    # Transponder 50 m before the mouth on a dock that faces north; the vehicle has moved on by less than a metre.
    np.testing.assert_allclose(second.position[:2] - MOUTH, [-50.0, 3.0], atol=1.0)
    np.testing.assert_array_equal(second.state[:2], second.position[:2])
    assert [o.kind for o in second.outcomes].count("usbl") == 1
    assert np.isfinite(second.covariance).all()


def drifting(name: str, delay: float, **settings) -> Estimate:
    """After five minutes at rest in the water, which flows east at 0.5 m/s: exact fixes each 5 s, `delay` old."""
    navigator, last = build(name, **settings), None
    for k in range(1, 601):
        time = 0.5 * k
        readings = [compass(time, 0.0)]
        if k % 10 == 0:
            seen = np.array([-50.0, -75.0 + 0.5 * (time - delay), 0.0, 0.0, 0.0, 0.0, 20.0])
            readings.append(Reading("usbl", time - delay, time, seen, k))
        last = navigator.update(time, readings, (), NONE)
    assert isinstance(last, Estimate)
    return last


@pytest.mark.parametrize("name", registry.ESTIMATORS)
def test_who_knows_current_and_delay(name: str) -> None:
    """Those without a current say there is none; those without the buffer lag behind by what it flows in the delay.

    That is 1.5 m in 3 s; a tenth of it, and of the flow, is left to what is believed of the noise. The regular filter
    lags behind its last fix besides.
    """
    estimate = drifting(name, 3.0)
    knows_current = name not in ("regular_ekf", "delay_only")
    expected = [0.0, 0.5] if knows_current else [0.0, 0.0]
    np.testing.assert_allclose(estimate.current, expected, atol=0.05)
    error = float(estimate.position[1] - MOUTH[1] - 75.0)
    if name == "current_only":
        assert error == pytest.approx(-1.5, abs=0.15)
    elif name == "regular_ekf":
        assert error < -1.4
    elif name == "delay_only":  # the last fix was made 3 s ago, and nothing moved it since
        assert error == pytest.approx(-1.5, abs=0.3)
    else:
        assert error == pytest.approx(0.0, abs=0.15)


@pytest.mark.parametrize("name", ["augmented_ekf", "ukf", "imm", "imm_biased"])
def test_an_error_of_the_dock_that_is_constant_does_not_average_out(name: str) -> None:
    """As a state, the dock's heading leaves its share across the line of sight, here north; as white noise it does not.

    Three degrees are 3.9 m across 75 m, however many fixes there are. White noise of that size falls by the root of
    the number of fixes that the filter remembers, more than four of them.
    """
    sigmas = [
        math.sqrt(drifting(name, 3.0, dock_heading_deg=degrees, dock_heading_state=constant).covariance[0, 0])
        for degrees, constant in ((3.0, True), (3.0, False), (0.0, True))
    ]
    assert sigmas[0] == pytest.approx(math.radians(3.0) * 75.0, rel=0.1)
    assert sigmas[1] < 0.6 * sigmas[0]
    assert sigmas[2] < sigmas[1]


MODULE = """
from dataclasses import replace

from auvsim.navigation import docking
from auvsim.navigation.settings import PaperSettings

def factory(setup):
    return docking.paper(replace(setup, settings=PaperSettings(**setup.settings)))

def failing(setup):
    raise ZeroDivisionError("division by nothing")

class Half:
    def update(self, time, readings, messages, commands):
        return None

def half(setup):
    return Half()

number = 3
"""


def test_factory_of_ones_own_from_a_package(tmp_path, monkeypatch) -> None:
    """`package.module:factory` is found in the working folder, and gets a set-up."""
    (tmp_path / "own_package").mkdir()
    (tmp_path / "own_package" / "estimator.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])  # without "", the working folder itself
    assert isinstance(build("own_package.estimator:factory", settings={"compass_deg": 2.0}), DockingNavigator)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("no_such_module:factory", "estimator 'no_such_module:factory': ModuleNotFoundError: No module named"),
        ("own_module:nothing", "estimator 'own_module:nothing': AttributeError: "),
        ("own_module:number", "estimator 'own_module:number' is not callable; it must be factory("),
        ("own_module:failing", "estimator 'own_module:failing' cannot be made: ZeroDivisionError: division by nothing"),
        ("own_module:half", "estimator 'own_module:half' made a Half without reset, states"),
        ("own_module:Half", "estimator 'own_module:Half' cannot be made: TypeError: "),
        ("broken_module:factory", "estimator 'broken_module:factory': SyntaxError: "),
    ],
)
def test_estimators_that_cannot_be_used(name: str, text: str, tmp_path, monkeypatch) -> None:
    """One line that names the estimator and what is wrong with it."""
    (tmp_path / "own_module.py").write_text(MODULE)
    (tmp_path / "broken_module.py").write_text("def factory(:\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError) as error:
        build(name)
    assert str(error.value).startswith(text)
    assert "\n" not in str(error.value)


def test_compass_is_averaged_across_180_degrees_and_moved_to_now() -> None:
    """Readings of a steady turn through south average to the heading now; without motion, to their mean."""
    rate = 0.1
    navigator, recorder = recording(yaw_rate=rate)
    navigator.update(0.5, [], (), NONE)  # the rate is known from here on
    readings = [compass(time, math.pi - 0.02 + rate * (time - 0.6)) for time in (0.6, 0.7, 0.8, 0.9, 1.0)]
    navigator.update(1.0, readings, (), NONE)
    assert recorder.ticks[1].heading == pytest.approx(wrap(math.pi + 0.02), abs=1e-12)

    navigator, recorder = recording()
    navigator.update(0.5, [compass(0.4, math.pi - 0.1), compass(0.5, -math.pi + 0.04)], (), NONE)
    assert recorder.ticks[0].heading == pytest.approx(wrap(math.pi - 0.03), abs=1e-12)


def test_averaging_reduces_white_noise() -> None:
    """Five readings of 1 degree: 0.45 degrees; 4000 averages determine that to 1.1 %, five times that are allowed."""
    navigator, recorder = recording()
    noise = stream(3, 0, "noise").normal(0.0, 1.0, (4000, 5))
    for k, row in enumerate(noise):
        navigator.update(0.5 * (k + 1), [compass(0.5 * k + 0.1 * i, x) for i, x in enumerate(row / 57.3)], (), NONE)
    headings = np.array([tick.heading for tick in recorder.ticks]) * 57.3
    assert headings.std() == pytest.approx(1.0 / math.sqrt(5.0), rel=0.055)


@pytest.mark.parametrize(("rate", "readings"), [(20.0, 10.0), (4.0, 2.0), (1.0, 1.0)])
def test_the_mean_of_n_readings_weighs_as_one_with_a_deviation_smaller_by_root_n(rate: float, readings: float) -> None:
    """The filter's first heading is one mean, its rate unknown; the second mean is fused with what that leaves."""
    navigator = build("augmented_ekf", rate=rate)
    navigator.update(0.5, [compass(0.5, 0.0)], (), NONE)
    packet = Reading("usbl", 0.5, 1.0, np.array([-50.0, 1.0, 2.0, 0.0, 0.0, 0.0, 12.0]), 0)
    estimate = navigator.update(1.0, [compass(1.0, 0.0), packet], (), NONE)
    assert estimate is not None
    mean = math.radians(AugmentedSettings().compass_deg) ** 2 / readings
    left = mean + (0.5 * DockingNoise().initial_yaw_rate) ** 2
    # 10 %: the rate decays within the half second.
    assert estimate.covariance[2, 2] == pytest.approx(mean * left / (mean + left), rel=0.1)


def test_feedback_is_averaged_and_else_the_commands_hold() -> None:
    """The rudder is that of the fins, by the allocation; without feedback, what was commanded."""
    navigator, recorder = recording()
    actuation = library.vehicle("remus100").actuation
    drives = [actuation.allocate(Commands(rudder, 0.05, shaft)) for rudder, shaft in ((0.1, 90.0), (0.2, 100.0))]
    feedback = [Reading("feedback", 0.1 * k, 0.1 * k, np.array(drive)) for k, drive in enumerate(drives)]
    navigator.update(0.5, feedback, (), Commands(-0.2, 0.0, 10.0))
    navigator.update(1.0, [], (), Commands(-0.2, 0.0, 10.0))
    assert (recorder.ticks[0].rudder, recorder.ticks[0].shaft) == pytest.approx((0.15, 95.0))
    assert (recorder.ticks[1].rudder, recorder.ticks[1].shaft) == (-0.2, 10.0)
    assert recorder.ticks[1].heading is None


def test_depth_is_smoothed_and_carried_on() -> None:
    """A steady descent is followed without lag, also past the last reading; noise is reduced to a third and less."""
    navigator, _ = recording()
    depths = []
    noise = stream(4, 0, "noise").normal(0.0, 0.05, 4000)
    for k, error in enumerate(noise):
        time = 0.1 * k
        reading = Reading("depth", time, time, np.array([5.0 + 0.1 * time + error]))
        depths.append(navigator.update(time + 0.05, [reading], (), NONE).position[2] - (5.0 + 0.1 * (time + 0.05)))
    settled = np.array(depths[500:])
    assert abs(settled.mean()) < 0.005
    assert settled.std() < 0.05 / 3.0


def test_estimate_passes_on_what_the_filter_says() -> None:
    """State by state, and the counts of what it refused."""
    estimate = recording(yaw_rate=0.04)[0].update(2.0, [], (), NONE)
    assert estimate.position[:2].tolist() == [101.0, 12.0]  # the filter's axes begin at the dock
    assert estimate.heading == 0.3
    assert estimate.velocity.tolist() == [1.0, 0.1, 0.04]
    assert estimate.current.tolist() == [0.2, -0.1]
    assert (estimate.refused, estimate.reasons) == (3, {"outlier": 2, "duplicate": 1})


def standing(position, attitude, time: float) -> Truth:
    """A vehicle at rest in still water."""
    return Truth(
        time=time,
        position=np.asarray(position, dtype=float),
        quaternion=euler_to_quaternion(*attitude),
        attitude=np.asarray(attitude, dtype=float),
        nu=np.zeros(6),
        current=np.zeros(3),
        actuators=np.zeros(5),
    )


@pytest.mark.parametrize("case", range(12))
def test_lever_arms_and_rotations_undo_the_measurement(case: int) -> None:
    """Noise-free fixes of a level vehicle at rest lead back to its origin, any dock attitude, any heading: < 1 cm."""
    generator = np.random.default_rng(case)
    dock = replace(
        DOCK,
        heading=generator.uniform(-math.pi, math.pi),
        pitch=generator.uniform(-0.2, 0.2),
        roll=generator.uniform(-0.2, 0.2),
    )
    usbl = UsblSettings(**EXACT, transceiver=(0.4, -0.7, -1.0), transponder=(-0.5, 0.2, -0.1))
    navigator, device = build(usbl=usbl), Usbl(usbl, stream(case, 0, "usbl"), dock)
    heading = generator.uniform(-math.pi, math.pi)
    place = np.array([*(MOUTH + generator.uniform(-80.0, 80.0, 2)), 18.0])
    before, estimate = standing(place, (0.0, 0.0, heading), 0.0), None
    for tick in range(1, 121):
        now = standing(place, (0.0, 0.0, heading), 0.5 * tick)
        pings = device.poll(before, now)
        readings = [compass(now.time, heading), Reading("depth", now.time, now.time, np.array([18.0]))]
        readings += [ping.reading._replace(received=now.time) for ping in pings]
        estimate, before = navigator.update(now.time, readings, (), NONE), now
    assert isinstance(estimate, Estimate)
    # The filter itself leaves millimetres: it believes in noise, but a minute at rest averages none.
    np.testing.assert_allclose(estimate.position, place, atol=0.01)
    assert wrap(estimate.heading - heading) == pytest.approx(0.0, abs=1e-3)


def test_the_lever_arms_matter() -> None:
    """The same fixes read with other lever arms lead elsewhere, by as much as these differ."""
    arm = UsblSettings(transponder=(1.0, 0.0, 0.0))
    packet = Reading("usbl", 0.5, 0.5, np.array([-50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0]))
    places = [n.update(0.5, [compass(0.5, 0.0), packet], (), NONE).position[:2] for n in (build(), build(usbl=arm))]
    np.testing.assert_allclose(places[0] - places[1], [1.0, 0.0], atol=0.01)


def trial_readings(seed: int) -> list[tuple[float, list[Reading]]]:
    """A minute of readings of a vehicle on a straight course, a fix every fifth update."""
    generator, updates = np.random.default_rng(seed), []
    for k in range(1, 121):
        time = 0.5 * k
        readings = [compass(time - 0.1 * i, 0.3 + 0.02 * generator.standard_normal()) for i in range(4, -1, -1)]
        readings.append(Reading("depth", time, time, np.array([20.0 + 0.05 * generator.standard_normal()])))
        if k % 5 == 0:
            seen = rotation(0, 0, 0.3) @ [time - 101.6, 0.0, 0.0] + 0.05 * generator.standard_normal(3)
            readings.append(Reading("usbl", time - 1.6, time, np.array([*seen, 0.0, 0.0, 0.0, 20.0]), k))
        updates.append((time, readings))
    return updates


@pytest.mark.parametrize("name", registry.ESTIMATORS)
def test_reset_is_as_new(name: str) -> None:
    """After another minute and a reset, the same readings give the same estimates, bit for bit."""
    used, fresh = build(name), build(name)
    for time, readings in trial_readings(1):
        used.update(time, readings, (), Commands(0.02, 0.0, 90.0))
    used.reset()
    for time, readings in trial_readings(2):
        a, b = (n.update(time, readings, (), Commands(0.0, 0.0, 80.0)) for n in (used, fresh))
        assert (a.time, a.heading, a.refused, a.initialised) == (b.time, b.heading, b.refused, b.initialised)
        for field in ("position", "velocity", "current", "covariance"):
            assert getattr(a, field).tobytes() == getattr(b, field).tobytes()


def test_what_is_refused_is_counted_by_reason() -> None:
    """A duplicate, a packet from the future, one that is no number, and outliers."""
    navigator = build()
    ahead = Commands(0.0, 0.0, planar_fit.fit_planar_model("remus100", 1.0).shaft_speed_for(1.0))
    for time, readings in trial_readings(3):
        last = navigator.update(time, readings, (), ahead)
    assert last.refused == 0
    *_, (time, readings) = trial_readings(3)
    fix = readings[-1]
    wrong = fix.value + np.array([30.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    unsound = np.where(np.arange(7) == 1, math.nan, fix.value)
    late = [
        fix,
        fix._replace(stamp=time + 9.0, sequence=501),
        fix._replace(value=unsound, sequence=502),
        fix._replace(stamp=time - 1.0, value=wrong, sequence=503),
        fix._replace(stamp=time - 50.0, sequence=504),
    ]
    counts = navigator.update(time + 0.5, late, (), ahead)
    assert counts.refused == 5
    reasons = {reason: count for reason, count in counts.reasons.items() if count}
    assert reasons == {"duplicate": 1, "future": 1, "not_finite": 1, "outlier": 1, "too_old": 1}
    told = estimator_events(last, counts)
    assert {kind for kind, _ in told} == {"refused"}
    assert {text for _, text in told} == {f"1 measurement: {reason.replace('_', ' ')}" for reason in reasons}
    assert estimator_events(counts, counts) == []
    anew = estimator_events(counts, replace(counts, reinitialised=1))
    assert [kind for kind, _ in anew] == ["reinitialised"]


def test_constant_errors_are_states_in_their_units() -> None:
    recorder = Recorder()
    units = {"compass": "rad", "dvl_sway": "m/s", "range_a": "m", "range_scale_a": "1", "light_eye": "rad"}
    recorder.filter.noise = DockingNoise(biases=dict.fromkeys(units, Bias(0.1)))
    states = DockingNavigator(cast(Any, recorder), library.vehicle("remus100").actuation, MOUTH).states
    assert {name: states[f"{name}_bias"] for name in units} == units


@pytest.mark.parametrize("off", [5.0, 10.0, 20.0])
@pytest.mark.parametrize("name", ["robust", "imm", "imm_biased", "augmented_ekf", "ukf", "dead_reckoning"])
def test_a_first_fix_that_is_an_outlier_is_overcome(name: str, off: float) -> None:
    """A straight course at a steady 1.1 m/s, 130 m before the mouth, with fixes every 5 s of which the first is wrong.

    From the fifth on, nothing is left of it: within three deviations, and a tenth of the largest.
    """
    parameters = planar_fit.fit_planar_model("remus100", 1.0).parameters
    setup = NavigatorSetup(
        vehicle="auv", settings=TypeAdapter(EstimatorSettings).validate_python({"kind": name}), parameters=parameters,
        actuation=library.vehicle("remus100").actuation, period=0.5, rates={"compass": 2.0}, usbl=UsblSettings(),
        dock=DOCK, sensors={"compass": CompassSettings()} if name == "dead_reckoning" else {},
    )  # fmt: skip
    navigator, noise, turned = registry.build(setup), np.random.default_rng(3), rotation(DOCK.roll, DOCK.pitch, 0.7)
    shaft, course = 130.0, np.array((math.cos(0.9), math.sin(0.9)))
    for k in range(1, 61):
        time = 0.5 * k
        away = np.array((-120.0, -60.0)) + parameters.steady_surge(shaft) * time * course
        readings = [compass(time, 0.9 + math.radians(1.0) * noise.standard_normal())._replace(sequence=k)]
        if k % 10 == 0:
            wrong = off * np.array((0.8, -0.6)) if k == 10 else 0.0
            sigma = UsblModel().deviation(float(np.linalg.norm(away)))
            seen = turned.T @ np.array((*(away + wrong), -2.0)) + sigma * noise.standard_normal(3)
            value = np.array((*seen, DOCK.heading, DOCK.pitch, DOCK.roll, 20.0))
            readings.append(Reading("usbl", time, time, value, k // 10))
        estimate = navigator.update(time, readings, (), Commands(0.0, 0.0, shaft))
        if k >= 50:
            error = estimate.position[:2] - MOUTH - away
            assert error @ np.linalg.solve(estimate.covariance[:2, :2], error) < 9.0 * 2.0
            assert np.hypot(*error) < 2.0
