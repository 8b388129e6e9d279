"""Standardised frames of an imaging sonar: where echoes are laid, what gain, shade and altitude do, and bad pings."""

import numpy as np
import pytest

from auvsim.navigation.sonar_frames import SectorFrames
from estimators.map_path.frames import EMPTY, NOT_FINITE, PolarGrid, SectorGrid, fault

GRID = SectorGrid(cell=0.5, shape=(40, 80), ranges=(1.0, 20.0), half_sector=np.radians(60.0))
POLAR = PolarGrid(
    bearings=tuple(np.radians(np.linspace(-60.0, 60.0, 121)).tolist()), ranges=tuple(np.arange(1.0, 21.0, 0.1).tolist())
)
NEARER = 0.8
MAKER = SectorFrames(polar=POLAR, grid=GRID, nearer=NEARER)


def speckle(seed: int) -> np.ndarray:
    """A ping of nothing but speckle."""
    return np.random.default_rng(seed).standard_exponential(POLAR.shape)


def made(intensity: np.ndarray, altitude: float = 4.0) -> np.ndarray:
    """The image of a ping."""
    return MAKER.frame(intensity, altitude=altitude, stamp=2.5, sequence=7).intensity


@pytest.mark.parametrize("altitude", [0.5, 6.0])
def test_an_echo_is_laid_on_the_floor_below_its_slant_range(altitude: float) -> None:
    """A bright sample from the near side of what lies at 0.3 rad to starboard and 5.3 m away on the floor."""
    bearing, horizontal = 0.3, 5.3
    beam = int(np.argmin(np.abs(np.array(POLAR.bearings) - bearing)))
    sample = int(np.argmin(np.abs(np.array(POLAR.ranges) - np.hypot(horizontal - NEARER, altitude))))
    intensity = np.ones(POLAR.shape)
    intensity[beam, sample] = 1000.0
    row, column = np.unravel_index(int(np.argmax(made(intensity, altitude))), GRID.shape)
    forward, starboard = GRID.centres[row, column]
    # Half a cell, and what half a beam and half a range bin move it.
    assert forward == pytest.approx(horizontal * np.cos(bearing), abs=0.25 + 0.1)
    assert starboard == pytest.approx(horizontal * np.sin(bearing), abs=0.25 + 0.1)


def test_spread_is_even_over_ranges() -> None:
    """Of echoes that fall, and whose contrast falls to a third; whatever the unit."""
    ranges = np.array(POLAR.ranges)
    fall, contrast = np.exp(-0.05 * ranges), 1.0 - 0.7 * ranges / ranges[-1]
    echo = fall * (1.0 - contrast + contrast * speckle(1))
    image = made(echo)
    values, distance = image[GRID.seen], np.hypot(*GRID.centres[GRID.seen].T)
    assert (values.mean(), values.std()) == (pytest.approx(0.0, abs=1e-9), pytest.approx(1.0, abs=1e-9))
    for low in range(2, 20, 3):
        ring = values[(distance >= low) & (distance < low + 3.0)]
        # A deviation of n cells errs by 1 / sqrt(2 n), 0.07 at n = 100 of the nearest; the rest is the parabola's.
        assert ring.mean() == pytest.approx(0.0, abs=0.25)
        assert ring.std() == pytest.approx(1.0, abs=0.25)
    assert not image[~GRID.seen].any()
    np.testing.assert_allclose(made(1e-9 * echo), image, atol=1e-9)


def test_a_bright_rock_leaves_its_range_as_it_is() -> None:
    """Cells of the same range more than 4 m to the side do not change by more than the frame's common scale."""
    plain = speckle(8)
    rocky = plain.copy()
    rocky[58:63, 80:86] *= 1e4
    ring = GRID.seen & (abs(np.hypot(*np.moveaxis(GRID.centres, 2, 0)) - np.hypot(8.3, 0.0)) < 1.0)
    aside = ring & (abs(GRID.centres[..., 1]) > 4.0)
    one, two = made(plain)[aside], made(rocky)[aside]
    assert np.corrcoef(one, two)[0, 1] > 0.999
    assert two.mean() == pytest.approx(one.mean(), abs=0.1)  # a ring's own mean would fall by its hot cells' share


def test_neighbouring_samples_of_a_cell_are_averaged_before_the_logarithm() -> None:
    """A sample that heard nothing beside loud ones leaves no hole."""
    beams, columns = np.indices(POLAR.shape)
    holes = np.where((beams + columns) % 2 == 0, 0.0, 2.0)
    far = np.hypot(*np.moveaxis(GRID.centres, 2, 0)) > 8.0
    noisy = speckle(2)
    image, plain = made(holes * noisy), made(noisy)
    # Half the samples are the same.
    assert 0.5 < np.corrcoef(image[GRID.seen & far], plain[GRID.seen & far])[0, 1] < 0.95
    assert image.min() > -6.0


def test_broad_shade_that_goes_with_the_vehicle_is_removed() -> None:
    """Two pings that share nothing but it agree no more than by chance: 0.03 is a deviation of 1200 cells."""
    shade = np.exp(0.8 * np.sin(3.0 * np.array(POLAR.bearings)))[:, None]
    one, two = (made(speckle(seed) * shade)[GRID.seen] for seed in (3, 4))
    assert abs(np.corrcoef(one, two)[0, 1]) < 0.1


def test_cells_out_of_the_sonars_ranges_are_0() -> None:
    """At 15 m altitude a slant range of 20.9 m ends 14.55 m ahead; at 0.2 m the nearest of 1 m begins at 0.98 m."""
    distance = np.hypot(*np.moveaxis(GRID.centres, 2, 0))
    image = made(speckle(5), 15.0)
    assert not image[distance > 14.6].any()
    assert np.count_nonzero(image[GRID.seen & (distance < 14.5)]) == np.count_nonzero(GRID.seen & (distance < 14.5))


def test_bad_pings_stay_bad() -> None:
    """They are refused by name; a stamp and a number go with every frame."""
    size = GRID.seen.size
    assert fault(made(np.zeros(POLAR.shape)), size) == EMPTY
    assert fault(made(np.full(POLAR.shape, np.nan)), size) == NOT_FINITE
    one_missing = speckle(6)
    one_missing[40, 100] = np.nan
    assert fault(made(one_missing), size) == NOT_FINITE
    frame = MAKER.frame(speckle(7), altitude=4.0, stamp=2.5, sequence=7)
    assert (frame.stamp, frame.sequence, fault(frame.intensity, size)) == (2.5, 7, "")
