"""The fin map of cross and X tails: there and back, limits, refusals."""

import numpy as np
import pytest

from auvsim import library
from auvsim.allocation import Allocation
from auvsim.errors import InputError

LIMIT = 0.25
CROSS = Allocation(
    names=("upper", "lower", "port", "starboard"),
    matrix=np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]),
    limit=LIMIT,
)
X_TAIL = Allocation(
    names=("a", "b", "c", "d"),
    matrix=np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 1.0], [1.0, -1.0]]) * np.sqrt(0.5),
    limit=LIMIT,
)


@pytest.mark.parametrize("allocation", [CROSS, X_TAIL], ids=["cross", "X"])
def test_what_is_asked_for_is_what_the_fins_do(allocation):
    random = np.random.default_rng(0)
    for rudder, elevator in random.uniform(-0.17, 0.17, (20, 2)):  # 0.17 sqrt 2 is inside the limit
        fins = allocation.fins(rudder, elevator)
        assert fins == pytest.approx(allocation.matrix @ [rudder, elevator], abs=1e-15)
        assert allocation.effective(fins) == pytest.approx((rudder, elevator), abs=1e-15)  # rounding
        assert allocation.effective(np.array(fins)) == allocation.effective(fins)


@pytest.mark.parametrize("allocation", [CROSS, X_TAIL], ids=["cross", "X"])
def test_beyond_the_limit_all_fins_shrink_together(allocation):
    for rudder, elevator in ((0.5, 0.0), (-0.4, 0.3), (0.1, 1.0), (0.25, -0.25)):
        fins = allocation.fins(rudder, elevator)
        assert max(map(abs, fins)) <= LIMIT * (1 + 1e-15)
        found = allocation.effective(fins)
        assert found[0] * elevator == pytest.approx(found[1] * rudder, abs=1e-15)  # the same direction
        assert found[0] * rudder + found[1] * elevator > 0.0


def test_disagreeing_fins_count_by_least_squares():
    assert CROSS.effective([0.1, 0.2, 0.0, -0.1]) == pytest.approx((0.15, -0.05), abs=1e-15)


@pytest.mark.parametrize(
    "matrix", [np.ones((3, 2)), np.ones((4, 3)), np.array([[1.0, 1.0]] * 4)], ids=["rows", "columns", "rank"]
)
def test_a_map_that_cannot_steer_both_ways_is_refused(matrix):
    with pytest.raises(InputError, match=r"allocation of 4 fins must be \(4, 2\) of rank 2"):
        Allocation(names=CROSS.names, matrix=matrix, limit=LIMIT)


def test_remus100_is_a_cross_tail():
    allocation = library.vehicle("remus100").allocation
    assert np.array_equal(allocation.matrix, CROSS.matrix)
    assert allocation.limit == pytest.approx(np.radians(15.0), abs=1e-5)  # the model's printed digits
