"""Columns that are not what they are called: told by the log's own heading and positions."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tanker

from auvsim.base.errors import InputError
from auvsim.identification.readers import read

U, V, PSI, NORTH, EAST = "surge [m/s]", "sway [m/s]", "heading [deg]", "north [m]", "east [m]"


@pytest.fixture(scope="module")
def log() -> dict[str, np.ndarray]:
    """Turns to both sides, so that all headings are there."""
    return tanker.sail("turns", 3, tanker.Sea(disturbance=2e-4), 240.0).log


def earth(log: dict[str, np.ndarray]) -> np.ndarray:
    """Velocity north + i east."""
    return (log[U] + 1j * log[V]) * np.exp(1j * np.radians(log[PSI]))


FAULTS: dict[str, tuple[Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]], str]] = {
    "earth": (lambda log: {U: earth(log).real, V: earth(log).imag}, "velocities north and east"),
    "swapped": (lambda log: {U: earth(log).imag, V: earth(log).real}, "velocities east and north"),
    "port": (lambda log: {V: -log[V]}, "sway is to port"),
    "astern": (lambda log: {U: -log[U], V: -log[V]}, "backwards"),
    "from east": (
        lambda log: {PSI: (90.0 - log[PSI]) % 360.0, "yaw_rate [deg/s]": -log["yaw_rate [deg/s]"]}, "counts from east"
    ),
}  # fmt: skip


def written(path: Path, log: dict[str, np.ndarray]) -> list[Path]:
    """The log as a file."""
    return [tanker.write(path / "log.csv", log)]


@pytest.mark.parametrize("fault", FAULTS)
def test_what_velocities_are(fault: str, log: dict[str, np.ndarray], tmp_path: Path) -> None:
    """Each fault by its own words, in one line."""
    change, said = FAULTS[fault]
    with pytest.raises(InputError, match=said) as caught:
        read(written(tmp_path, log | change(log)))
    assert "\n" not in str(caught.value)


def test_what_is_right_passes(log: dict[str, np.ndarray], tmp_path: Path) -> None:
    """As they are, and with 0.3 m/s of current, nothing is said; nor of a straight way, which tells nothing."""
    assert not [note for note in read(written(tmp_path, log)).notes if "velocit" in note]
    drifting = log | {NORTH: log[NORTH] + 0.3 * log["time [s]"]}
    assert not [note for note in read(written(tmp_path, drifting)).notes if "drift" in note]
    straight = {name: values[:300] for name, values in log.items()}
    read(written(tmp_path, straight | {PSI: 0.0 * straight[PSI] + 10.0, U: straight[U]}))


def test_ground_velocities_that_are_through_the_water_are_told(log: dict[str, np.ndarray], tmp_path: Path) -> None:
    """A current of 0.3 m/s stands between velocities called over ground and the positions."""
    named = {{U: "ground_surge [m/s]", V: "ground_sway [m/s]"}.get(name, name): values for name, values in log.items()}
    named[NORTH] = named[NORTH] + 0.3 * named["time [s]"]
    notes = read(written(tmp_path, named)).notes
    assert any("drift by 0.30 m/s" in note for note in notes)


def test_velocities_north_and_east_are_turned(log: dict[str, np.ndarray], tmp_path: Path) -> None:
    """By the heading, into those of the vehicle."""
    named = {name: values for name, values in log.items() if name not in (U, V)}
    named |= {"velocity_north [m/s]": earth(log).real, "velocity_east [m/s]": earth(log).imag}
    record = read(written(tmp_path, named)).records[0]
    plain = read(written(tmp_path, log)).records[0]
    np.testing.assert_allclose(record.measured[:, 6:8], plain.measured[:, 3:5], atol=1e-4)  # as far as it is written


def test_wind_by_speed_and_direction(log: dict[str, np.ndarray], tmp_path: Path) -> None:
    """An anemometer's wind from 30 deg to starboard blows towards the stern and to port."""
    still = np.ones(len(log[U]))
    record = read(written(tmp_path, log | {"aws [m/s]": 5.0 * still, "awa [deg]": 30.0 * still})).records[0]
    assert record.wind is not None
    expected = [-5.0 * math.cos(math.radians(30.0)), -5.0 * math.sin(math.radians(30.0))]
    np.testing.assert_allclose(record.wind[10:-10], np.tile(expected, (len(record.wind) - 20, 1)), rtol=1e-6)
