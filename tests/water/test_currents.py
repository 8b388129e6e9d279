"""Current fields: closed forms, exact derivatives and gradients, and the statistics of gusts."""

import math
from itertools import pairwise

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from scipy.linalg import expm
from scipy.stats import chi2

from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.water.currents import GUST_CORRELATION, build_current, listeners
from auvsim.water.settings import ApproachTurnSettings, CurrentSettings, GustSettings

DURATION = 200.0
UNIFORM = {"kind": "uniform", "speed": 0.4, "direction_deg": 120.0, "down": 0.05}
TURNING = {"kind": "turning", "speed": 0.5, "direction_deg": 30.0}
POINTS = [
    {"depth": 2.0, "speed": 0.5, "direction_deg": 10.0},
    {"depth": 8.0, "speed": 0.1, "direction_deg": 90.0},
    {"depth": 20.0, "speed": 0.3, "direction_deg": -60.0},
]
SMOOTH = {"kind": "shear", "points": POINTS}
LINEAR = {"kind": "shear", "profile": "linear", "points": POINTS[:2]}
KNOTS = {
    "kind": "knots",
    "knots": [
        {"time": 20.0, "north": 0.1, "east": -0.2},
        {"time": 60.0, "north": 0.5, "east": 0.3},
        {"time": 70.0, "north": -0.1},
    ],
}
GUST = {"kind": "gust", "intensity": 0.2, "correlation_time": 12.0}
SUM = {"kind": "sum", "terms": [UNIFORM, TURNING, {"kind": "sum", "terms": [SMOOTH, GUST]}]}
FIELDS = {
    "none": {"kind": "none"},
    "uniform": UNIFORM,
    "turning": TURNING,
    "smooth": SMOOTH,
    "linear": LINEAR,
    "gust": GUST,
    "knots": KNOTS,
    "sum": SUM,
}


def field(data, seed=5, duration=DURATION):
    settings = TypeAdapter(CurrentSettings).validate_python(data)
    return build_current(settings, stream(seed, 0, "current"), duration)


@pytest.mark.parametrize("name", FIELDS)
def test_derivative_and_gradient_match_finite_differences(name):
    current = field(FIELDS[name])
    random = np.random.default_rng(0)
    times = [*random.uniform(1.0, DURATION - 1.0, 40), *random.uniform(120.1, 129.9, 10)]  # in the turn too
    step = 1e-4
    for time in times:
        if min(abs(time - 120.0), abs(time - 130.0)) < step:
            continue  # the corners of the turn
        position = random.uniform([-100.0, -100.0, 0.5], [100.0, 100.0, 25.0])
        water = current.evaluate(time, position)
        after, before = (current.evaluate(time + s, position).velocity for s in (step, -step))
        # Second derivatives are below 1 m/s^3 and jump at most by that on a knot: the error is below step / 2 there;
        # between knots it is step^2 plus 1e-16 / step of rounding.
        assert water.derivative == pytest.approx((after - before) / (2 * step), abs=1e-5)
        for axis in range(3):
            shift = step * np.eye(3)[axis]
            difference = current.evaluate(time, position + shift).velocity
            difference = (difference - current.evaluate(time, position - shift).velocity) / (2 * step)
            # Same reasoning: second derivatives in depth are below 0.1 / (m s).
            assert water.gradient[:, axis] == pytest.approx(difference, abs=1e-5)


def test_uniform_flows_to_its_direction():
    water = field(UNIFORM).evaluate(0.0, np.zeros(3))
    assert water.velocity == pytest.approx([-0.2, 0.2 * math.sqrt(3.0), 0.05], abs=1e-15)  # cos, sin of 120 deg


def test_steady_uniform_fields_say_so_and_give_one_shared_value():
    for name, data in FIELDS.items():
        assert field(data).steady_uniform == (name in ("none", "uniform"))
    assert field({"kind": "sum", "terms": [UNIFORM, {"kind": "none"}]}).steady_uniform
    current = field(UNIFORM)
    water = current.evaluate(0.0, np.zeros(3))
    assert current.evaluate(50.0, np.ones(3)) is water  # no work per call
    with pytest.raises(ValueError, match="read-only"):
        water.velocity[0] = 1.0


@pytest.mark.parametrize(
    ("time", "direction"), [(0.0, 30.0), (120.0, 30.0), (125.0, 75.0), (130.0, 120.0), (199.0, 120.0)]
)
def test_turning_turns_ninety_degrees_between_120_and_130_seconds(time, direction):
    velocity = field(TURNING).evaluate(time, np.zeros(3)).velocity
    angle = math.radians(direction)
    assert velocity == pytest.approx([0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.0], abs=1e-15)


def test_turning_turns_at_nine_degrees_a_second_from_its_first_instant_to_its_last():
    rates = [
        np.linalg.norm(field(TURNING).evaluate(time, np.zeros(3)).derivative) for time in (119.9, 120.0, 129.9, 130.0)
    ]
    assert rates == pytest.approx([0.0, 0.5 * math.radians(9.0), 0.5 * math.radians(9.0), 0.0], abs=1e-15)


def test_shear_passes_through_its_points_and_stays_between_them():
    current = field(SMOOTH)
    for point in POINTS:
        angle = math.radians(point["direction_deg"])
        expected = point["speed"] * np.array([math.cos(angle), math.sin(angle), 0.0])
        assert current.evaluate(0.0, np.array([0.0, 0.0, point["depth"]])).velocity == pytest.approx(
            expected, abs=1e-15
        )
    above, first = (current.evaluate(0.0, np.array([0.0, 0.0, depth])) for depth in (0.0, 2.0))
    assert np.array_equal(above.velocity, first.velocity)
    assert not above.gradient.any()
    for upper, lower in pairwise(POINTS):  # monotone: no overshoot between points
        ends = [current.evaluate(0.0, np.array([0.0, 0.0, p["depth"]])).velocity for p in (upper, lower)]
        for depth in np.linspace(upper["depth"], lower["depth"], 50):
            velocity = current.evaluate(0.0, np.array([0.0, 0.0, depth])).velocity
            assert np.all(velocity >= np.minimum(*ends) - 1e-15)
            assert np.all(velocity <= np.maximum(*ends) + 1e-15)


@pytest.mark.parametrize("depth", [2.0, 8.0, 20.0])
def test_shear_gradient_is_continuous_at_its_points(depth):
    current = field(SMOOTH)
    above, below = (current.evaluate(0.0, np.array([0.0, 0.0, depth + s])).gradient for s in (-1e-9, 1e-9))
    assert above == pytest.approx(below, abs=1e-9)  # second derivatives below 0.1 / (m s) times 2e-9 m


def test_linear_shear_has_one_gradient_at_all_depths():
    current = field(LINEAR)
    gradients = [current.evaluate(0.0, np.array([0.0, 0.0, depth])).gradient for depth in (0.0, 5.0, 60.0)]
    north = (0.0 - 0.5 * math.cos(math.radians(10.0))) / 6.0
    east = (0.1 - 0.5 * math.sin(math.radians(10.0))) / 6.0
    for gradient in gradients:
        assert gradient == pytest.approx(np.array([[0, 0, north], [0, 0, east], [0, 0, 0]]), abs=1e-15)


def test_gust_has_the_variance_and_autocorrelation_of_the_second_order_process():
    settings = GustSettings(intensity=0.2, correlation_time=12.0)
    beta = GUST_CORRELATION / 12.0
    start, lags = 0.27, (0.0, 2.0, 6.0, 12.0, 25.0)  # start lies between knots
    gusts = [build_current(settings, stream(seed, 0, "current"), 30.0) for seed in range(1500)]
    samples = np.array([[gust.evaluate(start + lag, np.zeros(3)).velocity[:2] for lag in lags] for gust in gusts])
    rates = np.array([gust.evaluate(start, np.zeros(3)).derivative[:2] for gust in gusts])
    first, count = samples[:, 0, :].ravel(), 2 * len(gusts)
    for index, lag in enumerate(lags):
        correlation = (1.0 + beta * lag) * math.exp(-beta * lag)
        products = first * samples[:, index, :].ravel()
        # The mean of n products of two normals with correlation rho has sd sigma^2 sqrt((1 + rho^2) / n). 4.5 sd are
        # exceeded once in 150 000; the variance that interpolation lacks, 2e-5 of sigma^2, does not show.
        interval = 4.5 * 0.04 * math.sqrt((1.0 + correlation**2) / count)
        assert abs(products.mean() - 0.04 * correlation) < interval
    assert (1.0 + beta * 12.0) * math.exp(-beta * 12.0) == pytest.approx(math.exp(-1.0), rel=1e-12)
    low, high = chi2.ppf([1e-5, 1 - 1e-5], count) / count
    assert low < np.mean(rates**2) / (0.2 * beta) ** 2 < high  # x' has sd sigma beta
    cross = np.mean(samples[:, 0, 0] * samples[:, 0, 1])
    assert abs(cross) < 4.5 * 0.04 / math.sqrt(len(gusts))  # north and east are independent


def test_gust_is_exact_on_knots():
    """Predicts each knot from the one before with expm; what is left must be white with the Lyapunov covariance."""
    beta, step = GUST_CORRELATION / 12.0, 0.1 * 12.0 / GUST_CORRELATION
    gust = field({**GUST, "intensity": 1.0}, duration=3000.0)
    waters = [gust.evaluate(index * step, np.zeros(3)) for index in range(5000)]
    states = np.array([[w.velocity[0], w.derivative[0]] for w in waters])
    transition = expm(step * np.array([[0.0, 1.0], [-(beta**2), -2.0 * beta]]))
    stationary = np.diag([1.0, beta**2])
    residuals = states[1:] - states[:-1] @ transition.T
    whitened = np.linalg.solve(np.linalg.cholesky(stationary - transition @ stationary @ transition.T), residuals.T)
    count = whitened.shape[1]
    low, high = chi2.ppf([1e-5, 1 - 1e-5], count) / count
    assert np.all((low < np.mean(whitened**2, axis=1)) & (np.mean(whitened**2, axis=1) < high))
    assert abs(np.mean(whitened[0] * whitened[1])) < 4.5 / math.sqrt(count)  # sd 1/sqrt(n), as below
    assert np.all(np.abs(np.mean(whitened[:, 1:] * whitened[:, :-1], axis=1)) < 4.5 / math.sqrt(count))


def test_gust_replays_and_a_longer_one_starts_the_same_way():
    times = np.linspace(0.0, DURATION, 300)
    first, again, longer, other = (
        np.array([gust.evaluate(time, np.zeros(3)).velocity for time in times])
        for gust in (field(GUST), field(GUST), field(GUST, duration=500.0), field(GUST, seed=6))
    )
    assert np.array_equal(first, again)
    assert np.array_equal(first, longer)
    assert not np.any(first[:, :2] == other[:, :2])


@pytest.mark.parametrize("time", [-0.01, DURATION + 2.0])
def test_gust_refuses_times_it_was_not_drawn_for(time):
    with pytest.raises(InputError, match="build it for longer"):
        field(GUST).evaluate(time, np.zeros(3))


def test_sum_adds_and_a_term_does_not_change_the_noise_of_another():
    position = np.array([3.0, -4.0, 6.0])
    parts = [field(UNIFORM), field(TURNING), field(SMOOTH)]
    deterministic = field({"kind": "sum", "terms": [UNIFORM, TURNING, SMOOTH]}).evaluate(125.0, position)
    for name in ("velocity", "derivative", "gradient"):
        expected = sum(getattr(part.evaluate(125.0, position), name) for part in parts)
        assert getattr(deterministic, name) == pytest.approx(expected, abs=1e-15)
    alone = field({"kind": "sum", "terms": [GUST]}).evaluate(50.0, position).velocity
    both = field({"kind": "sum", "terms": [GUST, GUST]}).evaluate(50.0, position).velocity
    second = field({"kind": "sum", "terms": [{**GUST, "intensity": 0.0}, GUST]}).evaluate(50.0, position).velocity
    assert both - second == pytest.approx(alone, abs=1e-15)
    assert np.all(second[:2] != alone[:2])  # two gusts are two realisations


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"kind": "tide"}, "tide"),
        ({**UNIFORM, "speed": -0.1}, "greater than or equal to 0"),
        ({**TURNING, "start": 130.0, "end": 130.0}, "must be after its start"),
        ({"kind": "shear", "points": POINTS[:1]}, "at least 2"),
        ({"kind": "shear", "points": [POINTS[1], POINTS[0]]}, "must increase"),
        ({"kind": "shear", "profile": "linear", "points": POINTS}, "exactly 2"),
        ({**GUST, "correlation_time": 0.0}, "greater than or equal to 0.1"),
        ({"kind": "sum", "terms": []}, "at least 1"),
        ({"kind": "sum", "terms": [{"kind": "gust", "sigma": 1.0}]}, "sigma"),
    ],
)
def test_bad_settings_are_refused(data, text):
    with pytest.raises(ValidationError, match=text):
        field(data)


def test_approach_turn_turns_once_an_attempt_where_it_was_drawn() -> None:
    """Each attempt's turn starts once, within its approach, takes its time and turns by its angle, to either side."""
    settings = ApproachTurnSettings(speed=0.5, direction_deg=20.0, angle_deg=90.0, duration=10.0)
    sides, shares = set(), []
    for seed in range(40):
        turning = build_current(settings, stream(seed, 0, "current"), 1000.0)
        direction = math.radians(20.0)
        for attempt, length in ((1, 200.0), (2, 100.0)):
            begin, started = 500.0 * (attempt - 1), None
            for k in range(int(length) * 2 + 1):
                time, distance = begin + 0.5 * k, length - 0.5 * k
                turning.approach(attempt, distance, time)
                moving = np.any(turning.evaluate(time, np.zeros(3)).derivative != 0.0)
                if moving and started is None:
                    started = distance
            assert started is not None
            shares.append(started / length)
            velocity = turning.evaluate(begin + 400.0, np.zeros(3)).velocity
            after = math.atan2(velocity[1], velocity[0])
            turn = math.remainder(after - direction, 2 * math.pi)
            assert abs(turn) == pytest.approx(math.pi / 2, abs=1e-9)  # closed form: rate x duration
            assert np.linalg.norm(velocity) == pytest.approx(0.5, abs=1e-12)
            sides.add(math.copysign(1.0, turn))
            direction = after
    assert sides == {-1.0, 1.0}
    # 80 draws of a uniform share: the mean's standard deviation is 0.032, four of them allowed.
    assert np.mean(shares) == pytest.approx(0.5, abs=0.13)


def test_approach_turn_derivative() -> None:
    """The derivative is that of the velocity while it turns."""
    turning = build_current(ApproachTurnSettings(), stream(3, 0, "current"), 1000.0)
    for distance in range(200, 0, -1):
        turning.approach(1, float(distance), 100.0)
    h = 1e-4
    before, now, after = (turning.evaluate(104.0 + k * h, np.zeros(3)) for k in (-1, 0, 1))
    # Central differences of a sine at rate 0.16 rad/s: error below 1e-10.
    np.testing.assert_allclose((after.velocity - before.velocity) / (2 * h), now.derivative, atol=1e-9)


def test_only_currents_that_follow_the_approach_listen_to_it():
    """Alone and inside sums of sums; no other field is bothered."""
    approach = {"kind": "approach_turn"}
    assert listeners(field(UNIFORM)) == ()
    assert listeners(field(SUM)) == ()
    alone = field(approach)
    assert listeners(alone) == (alone,)
    nested = field({"kind": "sum", "terms": [UNIFORM, approach, {"kind": "sum", "terms": [GUST, approach]}]})
    found = listeners(nested)
    assert [type(part).__name__ for part in found] == ["ApproachTurn", "ApproachTurn"]
    assert found[0] is not found[1]


def test_knots_are_joined_by_straight_lines_and_held_beyond():
    current, here = field(KNOTS), np.zeros(3)
    for time, north, east in (
        (0.0, 0.1, -0.2),
        (20.0, 0.1, -0.2),
        (30.0, 0.2, -0.075),
        (65.0, 0.2, 0.15),
        (99.0, -0.1, 0.0),
    ):
        assert current.evaluate(time, here).velocity == pytest.approx([north, east, 0.0], abs=1e-15)
    with pytest.raises(ValidationError, match="they must increase"):
        field({"kind": "knots", "knots": [{"time": 5.0}, {"time": 5.0}]})
