"""The feature map lies where the features are; the map of the bound says how well frames match there."""

import math

import numpy as np
import pytest

from auvsim.reproduce.paper5.scenes import GRID, Conditions, arc, point_frame, simulate
from estimators.core.errors import ParameterError
from estimators.map_path.bound_map import height_information, image_information, match_bound
from estimators.map_path.feature_map import Mosaic, feature_map
from estimators.map_path.likelihood import FrameModel, Matcher
from estimators.map_path.matching import Match, Search, match
from estimators.map_path.poses import between, compose


def test_the_map_shows_features_where_they_are():
    """A lone feature that is seen from three sides is the map's brightest spot, to within a frame's cell."""
    run = simulate(arc(Conditions(duration=12)), 4)
    whole = feature_map([frame.intensity for frame in run.frames], run.poses, GRID)
    assert whole.counts.max() > 8
    rng = np.random.default_rng(9)
    alone = np.array([[14.0, -9.0]])
    poses = np.array([[3.0, -20.0, 0.8], [5.0, -17.0, 0.6], [2.0, -9.5, 0.1]])
    lone = feature_map([point_frame(alone, pose, 40.0, rng) for pose in poses], poses, GRID, cell=0.25)
    row, column = np.unravel_index(np.nanargmax(lone.image), lone.image.shape)
    place = np.array(lone.origin) + lone.cell * np.array([row, column])
    assert np.abs(place - alone[0]).max() <= 0.5
    west, east, south, north = lone.extent
    assert west < -20.0 - 15.0
    assert east > -5.0
    assert south < 0.0
    assert north > 20.0
    with pytest.raises(ParameterError, match="as many"):
        feature_map([], run.poses, GRID)


def test_a_map_that_grows_ends_as_the_whole_one():
    """To the bit; before the last frame it holds what the frames so far hold, nothing of those to come."""
    run = simulate(arc(Conditions(duration=5)), 8)
    images = [frame.intensity for frame in run.frames]
    mosaic = Mosaic(run.poses, GRID, 0.4)
    assert not mosaic.map.counts.any()
    for k, (image, pose) in enumerate(zip(images, run.poses, strict=True)):
        mosaic.add(image, pose)
        assert mosaic.map.counts.max() <= k + 1
    whole = feature_map(images, run.poses, GRID, 0.4)
    assert mosaic.map.image.tobytes() == whole.image.tobytes()
    assert (mosaic.map.origin, mosaic.map.cell) == (whole.origin, whole.cell)
    with pytest.raises(ParameterError, match="one frame at least"):
        Mosaic(run.poses[:0], GRID)


def test_the_bound_is_met_by_matches_of_strong_frames():
    """Errors along the path of matches at 14 dB, heading known, are the bound's to a third over 60 pairs.

    The bound is that of noise that is white in the frames; a match whose filter is not the signal's derivative loses
    a little, and the sector is not a square: hence the wide band, from 0.8.
    """
    rng = np.random.default_rng(11)
    features, snr = rng.uniform(-60.0, 60.0, (1440, 2)), 14.0
    cell = 0.25
    axis = np.arange(-60.0, 60.0, cell)
    image = np.zeros((axis.size, axis.size))
    for north, east in features:
        image += np.exp(-0.5 * ((axis - north) / 0.5) ** 2)[:, None] * np.exp(-0.5 * ((axis - east) / 0.5) ** 2)
    model = FrameModel().scaled(snr)
    bound = match_bound(image_information(image, cell, 0.0), cell, GRID, model.noise)
    middle = slice(axis.size // 4, -axis.size // 4)
    matcher, errors = Matcher(GRID, model), []
    for _ in range(60):
        first = np.array([*rng.uniform(-25.0, 25.0, 2), rng.uniform(-math.pi, math.pi)])
        second = compose(first, np.array([1.5, 0.0, 0.0]))
        ready = [matcher.prepare(point_frame(features, pose, snr, rng)) for pose in (first, second)]
        prior = np.diag([0.01, 0.01, 1e-8])
        found = match(matcher, ready[1], [ready[0]], between(first, second)[None], prior, Search())
        if isinstance(found, Match):
            errors.append(found.offset[:2] - 0.0)
    measured = np.sqrt(np.mean(np.square(errors)))
    assert len(errors) > 55
    assert 0.8 < measured / np.median(bound[middle, middle]) < 2.0


def test_a_flat_floor_tells_nothing_and_a_slope_neither():
    height = 0.3 * np.arange(80.0)[:, None] + np.zeros((80, 90))
    for each in (np.full((80, 90), 7.0), height):
        assert np.isinf(match_bound(height_information(each, 0.5, 0.0, 2.0), 0.5, GRID, 1.0)).all()


def test_ripples_tell_across_their_crests_only():
    """Information of sin(k x) by its closed form, g^2 a^2 k^4 / 4 along x; none along the crests."""
    k, a, cell = 2.0 * math.pi / 8.0, 0.4, 0.1
    north = cell * np.arange(800)
    height = a * np.sin(k * north)[:, None] + np.zeros((800, 60))
    information = height_information(height, cell, 0.0, 3.0)
    inner = information[80:720].mean(axis=(0, 1))
    assert inner[0, 0] == pytest.approx(9.0 * a**2 * k**4 / 4.0, rel=0.01)  # differences over 0.1 m of 8 m
    assert abs(inner[1, 1]) < 1e-12
    assert np.isinf(match_bound(information, cell, GRID, 1.0)).all()


def test_twice_the_noise_is_twice_the_bound_and_holes_are_refused():
    image = np.random.default_rng(2).normal(size=(60, 70))
    information = image_information(image, 0.5, 0.6)
    one, two = (match_bound(information, 0.5, GRID, noise) for noise in (0.7, 1.4))
    np.testing.assert_allclose(two, 2.0 * one)
    image[10, 12] = np.nan
    with pytest.raises(ParameterError, match="holes"):
        match_bound(image_information(image, 0.5, 0.0), 0.5, GRID, 1.0)
