"""The current near the sea floor: law of the wall, smooth joint, friction velocity."""

import math

import numpy as np
import pytest
from current_fields import build, check_derivatives

LAYER = {"kind": "boundary_layer", "speed": 0.6, "direction_deg": 120.0, "floor": 30.0, "thickness": 8.0}
LAYER |= {"roughness": 0.004}


def speed(height):
    return float(np.linalg.norm(build(LAYER).evaluate(3.0, np.array([5.0, 6.0, 30.0 - height])).velocity))


def test_gradient_is_exact():
    """Away from the floor, where the profile bends within centimetres."""
    check_derivatives(build(LAYER), [0, -50, -50, 5.0], [200, 50, 50, 29.0], within=1e-6)


def test_the_lower_layer_is_logarithmic():
    """The same rise of speed for each doubling of the height, kappa u_star ln 2, far above the roughness."""
    rises = [speed(2.0 * height) - speed(height) for height in (0.5, 1.0, 2.0)]
    expected = 0.6 * math.log(2.0) / math.log1p(8.0 / 0.004)
    assert rises == pytest.approx([expected] * 3, rel=6e-3)  # z_0 / (2 h ln 2) of it is missing
    assert speed(0.0) == 0.0
    assert speed(-1.0) == 0.0


def test_it_flows_at_full_speed_and_direction_above():
    water = build(LAYER).evaluate(0.0, np.array([0.0, 0.0, 10.0]))
    angle = math.radians(120.0)
    assert water.velocity == pytest.approx([0.6 * math.cos(angle), 0.6 * math.sin(angle), 0.0], abs=1e-15)
    assert not water.gradient.any()


@pytest.mark.parametrize("height", [4.0, 12.0])
def test_gradient_is_continuous_at_the_joints(height):
    low, high = (build(LAYER).evaluate(0.0, np.array([0, 0, 30.0 - height + s])).gradient for s in (1e-9, -1e-9))
    assert low == pytest.approx(high, abs=1e-9)


def test_a_layer_thinner_than_its_roughness_is_refused():
    with pytest.raises(ValueError, match="too thin for a roughness"):
        build({**LAYER, "thickness": 0.01})
