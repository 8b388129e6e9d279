"""Frames, poses and the comparison of two frames: geometry, calibration, bias and grid lock."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper5.scenes import ARRAY, GRID, Conditions, arc, point_frame, simulate
from estimators.core.errors import ParameterError
from estimators.map_path import frames, poses
from estimators.map_path.frames import PolarGrid, SectorGrid, to_sector
from estimators.map_path.likelihood import FrameModel, Matcher
from estimators.map_path.matching import Match, Search, match
from estimators.map_path.poses import Input

A, B = np.array([3.0, -2.0, 0.7]), np.array([-1.5, 4.0, -2.9])


def test_between_undoes_compose():
    relative = poses.between(A, B)
    np.testing.assert_allclose(poses.compose(A, relative), B, atol=1e-12)
    # By hand: a target due north of a vehicle that heads east is to port.
    np.testing.assert_allclose(
        poses.between(np.array([0, 0, math.pi / 2]), np.array([2.0, 0, 0])), [0, -2, -math.pi / 2], atol=1e-12
    )


def test_jacobians_of_between_are_its_differences():
    for which, J in enumerate(poses.between_jacobians(A, B)):
        for k in range(3):
            step = np.zeros((2, 3))
            step[which, k] = 1e-6
            change = poses.between(A + step[0], B + step[1]) - poses.between(A - step[0], B - step[1])
            np.testing.assert_allclose(J[:, k], change / 2e-6, atol=1e-8)


def test_increments_follow_the_midpoint_rule_and_errors_are_what_is_shown_too_much():
    inputs = (Input(1.5, 0.3, 1.0), Input(1.2, -0.1, 0.5))
    (pose,) = poses.increments(inputs, np.array([[0.2, 0.1]]))
    first = np.array([1.3 * math.cos(0.1), 1.3 * math.sin(0.1), 0.2])
    second = np.array([0.5 * math.cos(-0.05), 0.5 * math.sin(-0.05), -0.1])
    np.testing.assert_allclose(pose, poses.compose(first, second), atol=1e-12)


def test_the_sector_has_its_area():
    area = np.count_nonzero(GRID.seen) * GRID.cell**2
    assert area == pytest.approx(math.pi / 3.0 * (20.0**2 - 1.0), rel=0.01)  # cells of the edge
    eroded = GRID.holds(GRID.centres, 2.0)
    assert 0 < np.count_nonzero(eroded) < np.count_nonzero(GRID.seen)
    assert not GRID.holds(np.array([10.0, -17.4]))
    assert GRID.holds(np.array([10.0, -17.2]))


def test_a_polar_frame_keeps_its_features_places():
    """A spot at a bearing to port and a range lands in its cell, and a constant remains one."""
    polar = PolarGrid(bearings=tuple(np.radians(np.linspace(-62, 62, 125))), ranges=tuple(np.arange(0.5, 21.0, 0.1)))
    bearing, distance = math.radians(-25.0), 12.3
    spot = np.exp(
        -0.5 * ((np.array(polar.bearings)[:, None] - bearing) / 0.04) ** 2
        - 0.5 * ((np.array(polar.ranges)[None, :] - distance) / 0.5) ** 2
    )
    image = to_sector(spot, polar, GRID)
    peak = GRID.centres[np.unravel_index(np.argmax(image), GRID.shape)]
    assert np.abs(peak - distance * np.array([math.cos(bearing), math.sin(bearing)])).max() <= 0.5 * GRID.cell + 0.01
    constant = to_sector(np.full(polar.shape, 2.5), polar, GRID)
    np.testing.assert_allclose(constant[GRID.seen], 2.5, rtol=1e-12)


def test_the_array_hears_a_source_where_it_is():
    """The beam pattern peaks at the source's bearing with gain 1, and is 20 dB down three beam widths away."""
    signals = ARRAY.steering(np.array([math.radians(20.0)])) @ np.ones((1, len(ARRAY.ranges)))
    envelope = ARRAY.beamform(signals)[:, 5]
    bearings = np.array(ARRAY.grid.bearings)
    assert bearings[np.argmax(envelope)] == pytest.approx(math.radians(20.0), abs=0.02)  # half a beam's spacing
    assert envelope.max() == pytest.approx(1.0, abs=0.05)
    assert envelope[np.abs(np.sin(bearings) - math.sin(math.radians(20.0))) > 0.3].max() < 0.1


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda z: np.full_like(z, np.nan), frames.NOT_FINITE),
        (lambda z: np.zeros_like(z), frames.EMPTY),
        (lambda z: z[:-1], frames.WRONG_SIZE),
        (lambda z: np.where(np.arange(z.size).reshape(z.shape) % 3 == 0, 9.0, z), frames.SATURATED),
        (lambda z: z, ""),
    ],
)
def test_bad_frames_are_named(spoil, reason):
    image = np.random.default_rng(1).normal(size=GRID.shape)
    assert frames.fault(spoil(image), GRID.seen.size, 9.0) == reason


def test_bad_grids_are_refused():
    with pytest.raises(ParameterError, match="ranges rising"):
        SectorGrid(ranges=(5.0, 2.0))
    with pytest.raises(ParameterError, match="equal steps"):
        PolarGrid(bearings=(0.0, 0.1), ranges=(1.0, 2.0, 4.0))


def test_upsampling_goes_through_the_cells():
    """Every fifth sample is the cell itself, and a smooth image is met between them."""
    matcher = Matcher(GRID, FrameModel())
    prepared = matcher.prepare(np.random.default_rng(2).normal(size=GRID.shape))
    np.testing.assert_allclose(prepared.fine[2::5, 2::5], prepared.values, atol=1e-9)


def biases(conditions, model, seeds):
    """Errors (k, 3) of the best pose of each frame against the one before, searched about the truth."""
    errors = []
    for seed in seeds:
        run = simulate(conditions, seed)
        matcher = Matcher(GRID, model)
        ready = [matcher.prepare(frame.intensity) for frame in run.frames]
        truth = poses.between(run.poses[:-1], run.poses[1:])
        for k, relative in enumerate(truth):
            found = match(matcher, ready[k + 1], [ready[k]], relative[None], np.diag([0.04, 0.04, 1e-3]), Search())
            if isinstance(found, Match):
                errors.append((found.offset, found.covariance))
    offsets, covariances = (np.array(each) for each in zip(*errors, strict=True))
    return offsets, covariances


@pytest.mark.parametrize(("weighting", "curved"), [("field", False), ("field", True), ("point", True)])
def test_a_match_has_hardly_a_bias(weighting, curved):
    """At 20 dB at most 2 cm a frame forward, straight and on an arc; a sum over the overlap has 5 to 8 cm."""
    conditions = Conditions(duration=20, snr=20.0)
    model = FrameModel(weighting=weighting).scaled(20.0)
    offsets, _ = biases(arc(conditions) if curved else conditions, model, range(2))
    assert len(offsets) > 35
    assert np.abs(offsets[:, :2].mean(axis=0)).max() < 0.02


def test_the_grid_does_not_lock_the_match():
    """1.5 m are three cells: errors on the straight course are not smaller than off the grid and turning."""
    deviations = []
    for conditions in (Conditions(duration=20, snr=10.0), arc(Conditions(duration=20, snr=10.0, speed=1.37))):
        offsets, _ = biases(conditions, FrameModel().scaled(10.0), range(2))
        deviations.append(offsets[:, 0].std())
    assert 0.5 < deviations[0] / deviations[1] < 2.0


def test_the_covariance_of_a_match_is_that_of_its_errors():
    """NEES of single matches at 6 dB; the band is wide since a Gaussian field is an approximation."""
    offsets, covariances = biases(Conditions(duration=30, snr=6.0), FrameModel().scaled(6.0), range(2))
    squares = np.einsum("ni,nij,nj->n", offsets, np.linalg.inv(covariances), offsets) / 3.0
    assert 0.6 < squares.mean() < 1.6


def test_a_match_finds_a_known_offset():
    """Two nearly noiseless frames whose relative pose is wrong by a lopsided offset."""
    rng = np.random.default_rng(5)
    features = rng.uniform(-30.0, 30.0, (360, 2))
    model = FrameModel().scaled(30.0)
    matcher = Matcher(GRID, model)
    here, there = np.array([0.0, 0.0, 0.3]), poses.compose(np.array([0.0, 0.0, 0.3]), np.array([1.3, 0.2, 0.05]))
    earlier, later = (matcher.prepare(point_frame(features, pose, 30.0, rng)) for pose in (here, there))
    offset = np.array([0.31, -0.22, 0.03])
    predicted = poses.compose(there, poses.between(offset, np.zeros(3)))
    prior = np.diag([0.09, 0.09, 0.0016])
    found = match(matcher, later, [earlier], poses.between(here, predicted)[None], prior, Search())
    assert isinstance(found, Match)
    assert (np.abs(found.offset - offset) < (0.03, 0.03, 0.004)).all()  # a twentieth of a cell
    far = match(matcher, later, [earlier], np.array([[60.0, 0.0, 0.0]]), prior, Search())
    assert far == "no_overlap"


def test_a_sonar_ahead_of_the_origin_swings_with_each_turn():
    """Frames from 1.7 m ahead, the vehicle turned by 0.2 rad: its own step is found; taken at the origin it is off.

    The transducer moves by 1.7 (1 - cos 0.2, sin 0.2) more than the origin, 3 and 34 cm.
    """
    ahead, step = 1.7, np.array([1.1, -0.3, 0.2])
    rng, first = np.random.default_rng(11), np.array([2.0, -3.0, 0.8])
    features = rng.uniform(-45.0, 45.0, (800, 2))
    places = [poses.compose(pose, np.array([ahead, 0.0, 0.0])) for pose in (first, poses.compose(first, step))]
    images = [point_frame(features, place, 20.0, rng) for place in places]
    found = {}
    for nose in (ahead, 0.0):
        matcher = Matcher(replace(GRID, ahead=nose), FrameModel(density=0.1).scaled(20.0))
        earlier, later = (matcher.prepare(image) for image in images)
        prior = np.diag(np.square((0.4, 0.4, 0.05)))
        result = match(matcher, later, [earlier], step[None], prior, Search())
        assert isinstance(result, Match)
        found[nose] = result.offset
    np.testing.assert_allclose(found[ahead], 0.0, atol=0.03)  # 20 dB: 1 cm
    # Of the pose turned by 0.2 rad: the excess seen in the later axes.
    excess = np.array([ahead * (math.cos(0.2) - 1.0), ahead * math.sin(0.2)])
    turned = np.array([[math.cos(0.2), math.sin(0.2)], [-math.sin(0.2), math.cos(0.2)]]) @ excess
    np.testing.assert_allclose(found[0.0][:2], turned, atol=0.04)


def test_a_grid_ahead_of_the_origin_sees_the_same_frame():
    """What a polar sonar shows does not depend on where it is mounted; its sector moves with it."""
    polar = PolarGrid(bearings=tuple(np.radians(np.linspace(-62, 62, 63))), ranges=tuple(np.arange(0.5, 21.0, 0.5)))
    image, moved = np.random.default_rng(2).random(polar.shape), replace(GRID, ahead=-2.5)
    np.testing.assert_allclose(to_sector(image, polar, moved), to_sector(image, polar, GRID), atol=1e-9)
    np.testing.assert_array_equal(moved.seen, GRID.seen)
    assert moved.holds(np.array([17.4, 0.3]))
    assert not moved.holds(np.array([17.6, 0.3]))
