"""Frames: the flip to MuJoCo's world and back, Euler angles and quaternions against SciPy's rotations."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvsim.base.frames import (
    euler_to_quaternion,
    flip,
    flip_matrix,
    flip_quaternion,
    quaternion_to_euler,
    rotation,
    wrap,
)

TURN = Rotation.from_euler("x", math.pi).as_matrix()
RANDOM = np.random.default_rng(0)
ANGLES = [tuple(RANDOM.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1])) for _ in range(20)]
ROUNDING = 1e-14


def test_the_flip_is_half_a_turn_about_x():
    vectors = RANDOM.normal(size=(7, 3))
    assert flip(vectors) == pytest.approx(vectors @ TURN.T, abs=ROUNDING)
    assert np.array_equal(flip(flip(vectors)), vectors)
    assert np.array_equal(flip(np.array([1.0, 2.0, 3.0])), [1.0, -2.0, -3.0])  # north, east, down -> north, west, up


def test_a_matrix_is_flipped_as_the_map_it_is():
    for size in (3, 6):
        matrix, vector = RANDOM.normal(size=(size, size)), RANDOM.normal(size=size)
        turned = flip(vector.reshape(-1, 3)).ravel()
        image = flip((matrix @ vector).reshape(-1, 3)).ravel()
        assert flip_matrix(matrix) @ turned == pytest.approx(image, abs=ROUNDING)


@pytest.mark.parametrize("angles", ANGLES)
def test_euler_angles_quaternions_and_matrices_agree_with_scipy(angles):
    roll, pitch, yaw = angles
    expected = Rotation.from_euler("ZYX", (yaw, pitch, roll))
    assert rotation(roll, pitch, yaw) == pytest.approx(expected.as_matrix(), abs=ROUNDING)
    quaternion = euler_to_quaternion(roll, pitch, yaw)
    x, y, z, w = expected.as_quat()
    assert abs(quaternion @ [w, x, y, z]) == pytest.approx(1.0, abs=ROUNDING)
    # arcsin near 1.5 rad loses a factor 1 / cos(1.5) = 14.
    assert quaternion_to_euler(quaternion) == pytest.approx(angles, abs=20 * ROUNDING)
    assert quaternion_to_euler(-quaternion) == pytest.approx(angles, abs=20 * ROUNDING)


@pytest.mark.parametrize("angles", ANGLES[:5])
def test_a_flipped_quaternion_is_the_attitude_in_mujocos_world(angles):
    quaternion = flip_quaternion(euler_to_quaternion(*angles))
    w, x, y, z = quaternion
    assert Rotation.from_quat((x, y, z, w)).as_matrix() == pytest.approx(
        TURN @ rotation(*angles) @ TURN.T, abs=ROUNDING
    )
    assert np.array_equal(flip_quaternion(quaternion), euler_to_quaternion(*angles))


def test_heading_is_clockwise_from_north_and_pitch_is_nose_up():
    ahead = np.array([1.0, 0.0, 0.0])
    assert rotation(0.0, 0.0, math.pi / 2) @ ahead == pytest.approx([0, 1, 0], abs=ROUNDING)  # east
    assert (rotation(0.0, 0.3, 0.0) @ ahead)[2] < 0.0  # up
    assert (rotation(0.3, 0.0, 0.0) @ [0.0, 1.0, 0.0])[2] > 0.0  # starboard down


def test_at_the_pole_of_pitch_the_angles_are_finite():
    for pitch in (math.pi / 2, -math.pi / 2):
        assert quaternion_to_euler(euler_to_quaternion(0.0, pitch, 0.0))[1] == pytest.approx(pitch, abs=1e-7)


def test_wrap():
    for angle in (-10.0, -math.pi, -1.0, 0.0, 3.0, math.pi, 100.0):
        wrapped = wrap(angle)
        assert -math.pi < wrapped <= math.pi
        assert math.sin(wrapped - angle) == pytest.approx(0.0, abs=1e-13)  # 100 rad, rounded
        assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-13)
    assert wrap(math.pi) == math.pi
    assert wrap(-math.pi) == math.pi
