"""NED to ENU and forward-starboard-down to forward-port-up, against rotation matrices written out independently."""

import numpy as np
from scipy.spatial.transform import Rotation

from auvsim.ros.frames import enu, enu_quaternion

TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
TO_FLU = np.diag([1.0, -1.0, -1.0])


def test_vectors_and_attitudes():
    """A vector of the body comes to the same place in the world by both conventions, for random attitudes."""
    turns = Rotation.random(50, random_state=4)
    wxyz = np.roll(turns.as_quat(), 1, axis=1)
    body = np.random.default_rng(1).normal(size=(50, 3))
    theirs = Rotation.from_quat(np.roll(enu_quaternion(wxyz), -1, axis=1))
    np.testing.assert_allclose(theirs.apply(body @ TO_FLU), turns.apply(body) @ TO_ENU.T, atol=1e-14)
    np.testing.assert_allclose(enu(turns.apply(body)), turns.apply(body) @ TO_ENU.T, atol=0.0)


def test_known_cases():
    """North is a yaw of 90 degrees, east of 0; a climb keeps its nose up, which is a negative pitch about port."""
    for heading, yaw in ((0.0, 90.0), (90.0, 0.0), (200.0, -110.0)):
        q = np.roll(Rotation.from_euler("ZYX", [heading, 10.0, 0.0], degrees=True).as_quat(), 1)
        found = Rotation.from_quat(np.roll(enu_quaternion(q), -1)).as_euler("ZYX", degrees=True)
        np.testing.assert_allclose(found, [yaw, -10.0, 0.0], atol=1e-12)


def test_own_inverse():
    """What turns there turns back."""
    q = np.roll(Rotation.random(9, random_state=2).as_quat(), 1, axis=1)
    np.testing.assert_allclose(enu_quaternion(enu_quaternion(q)), q, atol=1e-15)
    vector = np.array([3.0, -2.0, 5.0])
    np.testing.assert_array_equal(enu(enu(vector)), vector)
