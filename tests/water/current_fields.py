"""What tests of current fields share."""

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from auvsim.base.randomness import stream
from auvsim.water.currents import CurrentField, build_current
from auvsim.water.settings import CurrentSettings


def build(data: Any, seed: int = 5, duration: float = 200.0) -> CurrentField:
    """The field of settings given as YAML would give them."""
    settings = TypeAdapter(CurrentSettings).validate_python(data)
    return build_current(settings, stream(seed, 0, "current"), duration)


def check_derivatives(
    field: CurrentField, low: Any, high: Any, *, seed: int = 0, count: int = 60, within: float = 1e-6
):
    """Compares derivative and gradient with central differences at random times and places (t, n, e, d) in a box.

    Differences are of the fourth order over 1e-2: their own error is that to the fourth times a fifth derivative, and
    1e-14 of rounding.
    """
    random, step = np.random.default_rng(seed), 1e-2

    def difference(values):
        return (8.0 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12.0 * step)

    for _ in range(count):
        time, *place = random.uniform(low, high).tolist()
        place = np.array(place)
        water = field.evaluate(time, place)
        shifts = (-2, -1, 1, 2)
        found = difference({k: field.evaluate(time + k * step, place).velocity for k in shifts})
        assert water.derivative == pytest.approx(found, abs=within)
        for axis in range(3):
            shift = step * np.eye(3)[axis]
            found = difference({k: field.evaluate(time, place + k * shift).velocity for k in shifts})
            assert water.gradient[:, axis] == pytest.approx(found, abs=within)
