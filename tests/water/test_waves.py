"""Waves: potential theory, the surface they move, the spectrum they come from."""

import math

import numpy as np
import pytest
from current_fields import build, check_derivatives
from scipy.integrate import quad
from scipy.stats import chi2

from auvsim.base.randomness import stream
from auvsim.water.settings import WavesSettings
from auvsim.water.surface import CALM, surface
from auvsim.water.waves import GRAVITY, Waves, jonswap, wave_number

SEA = {"kind": "waves", "height": 1.5, "period": 7.0, "direction_deg": 40.0, "floor": 25.0, "components": 30}
ALONG = np.array([math.cos(math.radians(40.0)), math.sin(math.radians(40.0)), 0.0])


def places(count, seed=2):
    random = np.random.default_rng(seed)
    return [(float(t), np.array(x)) for t, *x in random.uniform([0, -50, -50, 0.1], [200, 50, 50, 24.9], (count, 4))]


def test_derivative_and_gradient_are_exact():
    check_derivatives(build(SEA), [0, -50, -50, 0.1], [200, 50, 50, 24.9])
    check_derivatives(build(SEA), [0, -50, -50, -1.5], [200, 50, 50, -0.1])  # in the crests


def test_flow_is_irrotational_and_without_divergence():
    for time, place in places(50):
        gradient = build(SEA).evaluate(time, place).gradient
        assert gradient == pytest.approx(gradient.T, abs=1e-15)
        assert np.trace(gradient) == pytest.approx(0.0, abs=1e-15)


def test_long_crests():
    sideways = np.array([-ALONG[1], ALONG[0], 0.0])
    for time, place in places(10):
        one, other = (build(SEA).evaluate(time, place + s * sideways) for s in (0.0, 13.0))
        assert one.velocity == pytest.approx(other.velocity, abs=1e-12)
        assert one.velocity @ sideways == pytest.approx(0.0, abs=1e-14)


def test_the_surface_moves_with_the_water_and_the_floor_stops_it():
    """Linear conditions: d(eta)/dt = upward velocity and d(u)/dt = -g d(eta)/dx at z = 0; no flow through the floor."""
    sea = build(SEA)
    for time, place in places(20):
        place[2] = 0.0
        water, top = sea.evaluate(time, place), surface(sea, time, place)
        assert top.rate == pytest.approx(-water.velocity[2], abs=1e-12)
        slope = np.array([top.north_slope, top.east_slope, 0.0])
        assert water.derivative[:2] == pytest.approx(-GRAVITY * slope[:2], abs=1e-12)
        step = 1e-4
        ahead, behind = (surface(sea, time + s, place).elevation for s in (step, -step))
        assert top.rate == pytest.approx((ahead - behind) / (2 * step), abs=1e-6)
        ahead, behind = (surface(sea, time, place + s * ALONG).elevation for s in (step, -step))
        assert slope @ ALONG == pytest.approx((ahead - behind) / (2 * step), abs=1e-6)
        place[2] = 25.0
        assert sea.evaluate(time, place).velocity[2] == pytest.approx(0.0, abs=1e-14)


def test_waves_travel_to_their_direction():
    """A lone wave looks the same a phase velocity further on a second later."""
    sea = build({**SEA, "components": 1})
    speed = float(sea.frequencies[0] / sea.wave_numbers[0])
    assert surface(sea, 11.0, speed * ALONG).elevation == pytest.approx(
        surface(sea, 10.0, 0 * ALONG).elevation, abs=1e-9
    )


@pytest.mark.parametrize(("frequency", "floor"), [(0.5, 3.0), (0.9, 25.0), (3.0, 500.0), (0.05, 1.0)])
def test_dispersion(frequency, floor):
    k = wave_number(frequency, floor)
    assert GRAVITY * k * math.tanh(k * floor) == pytest.approx(frequency**2, rel=1e-10)


def test_orbits_shrink_with_depth_as_deep_water_has_it():
    """exp(-k z) where the floor is far: speed at z over speed at the surface, of a lone wave."""
    sea = build({**SEA, "components": 1, "floor": 500.0})
    k = float(sea.wave_numbers[0])
    ratio = [np.linalg.norm(sea.evaluate(3.0, np.array([0.0, 0.0, z])).velocity) for z in (0.0, 10.0)]
    assert ratio[1] / ratio[0] == pytest.approx(math.exp(-10.0 * k), rel=1e-9)


def test_energy_is_that_of_the_significant_height():
    """The variance of the elevation over 40 seas at random times is (H / 4)^2; each sea's own, over time, too."""
    settings = WavesSettings(**{key: value for key, value in SEA.items() if key != "kind"})
    draws = []
    for seed in range(400):
        sea = Waves(settings, stream(seed, 0, "current"))
        draws.append(sea.surface(50.0, np.zeros(3)).elevation)
    # A sum of 30 waves is nearly normal; the chi-squared interval of 1e-5 each side has room for what it is not.
    low, high = chi2.ppf([1e-5, 1 - 1e-5], 400) / 400
    assert low < np.mean(np.square(draws)) / (1.5 / 4.0) ** 2 < high
    assert sea.amplitude == pytest.approx(1.5 / 4.0 * math.sqrt(2.0 / 30.0))


def test_frequencies_are_distributed_as_the_spectrum():
    """Each component lies in its share of the energy; means over 200 seas are those of the spectrum by quadrature."""
    settings = WavesSettings(height=1.0, period=2.0 * math.pi, components=50)
    found = np.array([Waves(settings, stream(seed, 0, "current")).frequencies for seed in range(200)])

    def moment(power):
        return quad(lambda w: w**power * float(jonswap(np.array(w), 3.3)), 0.5, 6.0, limit=200, points=[1.0])[0]

    mean, square = moment(1) / moment(0), moment(2) / moment(0)
    # Stratified: the mean of 10 000 has a deviation below that of independent draws, 0.5 / 100 = 0.005.
    assert found.mean() == pytest.approx(mean, abs=0.005)
    assert np.square(found).mean() == pytest.approx(square, abs=0.03)
    assert np.all(np.diff(found.mean(axis=0)) > 0)


def test_left_out_energy_is_small():
    inside = quad(lambda w: float(jonswap(np.array(w), 3.3)), 0.5, 6.0, limit=200, points=[1.0])[0]
    above = quad(lambda w: float(jonswap(np.array(w), 3.3)), 6.0, 500.0, limit=200)[0]
    below = quad(lambda w: float(jonswap(np.array(w), 3.3)), 0.1, 0.5)[0]
    assert (below + above) / inside < 1e-3


def test_a_sea_is_its_seeds():
    place = np.array([1.0, 2.0, 3.0])
    first, again, other = (build(SEA, seed=seed).evaluate(9.0, place).velocity for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.any(first == other)


def test_other_fields_leave_the_surface_calm_and_sums_add():
    assert surface(build({"kind": "uniform"}), 3.0, np.zeros(3)) == CALM
    both = build({"kind": "sum", "terms": [{"kind": "uniform"}, SEA, {"kind": "sum", "terms": [SEA]}]})
    parts = [part.surface(4.0, np.ones(3)).elevation for part in (both.terms[1], both.terms[2].terms[0])]
    assert surface(both, 4.0, np.ones(3)).elevation == pytest.approx(sum(parts), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"height": 0.0}, "greater than 0"),
        ({"height": 5.0, "period": 3.0}, "would break at 3.0 s; at most 1.4"),
        ({"period": -1.0}, "greater than 0"),
        ({"peakedness": 0.5}, "greater than or equal to 1"),
    ],
)
def test_a_spectrum_without_energy_or_beyond_nature_is_refused(change, text):
    with pytest.raises(ValueError, match=text):
        build({**SEA, **change})
