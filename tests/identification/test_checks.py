"""Data that cannot be right are refused, each with what would make them right, and nothing is written."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tables import TRUE, columns, every, synthetic, write

from auvsim import cli
from auvsim.base.errors import InputError
from auvsim.identification import checks
from auvsim.identification.readers import read
from auvsim.identification.signals import Signal, Signals

Table = dict[str, np.ndarray]


def renamed(table: Table, old: str, new: str) -> Table:
    """The same columns, one under another header."""
    return {(new if name == old else name): values for name, values in table.items()}


def without(table: Table, *names: str) -> Table:
    """The same without some columns."""
    return {name: values for name, values in table.items() if name.split(" ")[0] not in names}


WRONG: dict[str, tuple[Callable[[Table], Table], str]] = {
    "rudder in degrees named radians": (
        lambda t: renamed(t, "rudder [deg]", "rudder [rad]"), "name the column `rudder"),
    "rudder in radians named degrees": (
        lambda t: {**t, "rudder [deg]": np.radians(t["rudder [deg]"])}, "in other units than its header says"),
    "heading in degrees named radians": (
        lambda t: renamed(t, "heading [deg]", "heading [rad]"), "these are degrees; name it `heading [deg]`"),
    "heading in degrees without a unit": (lambda t: renamed(t, "heading [deg]", "heading"), "`heading [deg]`"),
    "heading in degrees that never wraps": (
        lambda t: {**without(t, "heading"), "heading [rad]": np.unwrap(t["heading [deg]"], period=360.0)},
        "`heading [deg]`"),
    "heading in radians named degrees": (
        lambda t: {**t, "heading [deg]": np.radians(t["heading [deg]"])}, "radians"),
    "yaw rate in degrees named radians": (
        lambda t: renamed(t, "yaw_rate [deg/s]", "yaw_rate [rad/s]"), "57"),
    "shaft in revolutions a minute named radians a second": (
        lambda t: renamed(t, "n [rpm]", "n [rad/s]"), "name the column `n [rpm]`"),
    "speeds in knots named metres a second": (
        lambda t: {**t, "dvl_u [cm/s]": t["dvl_u [cm/s]"] * 3600 / 1852}, "is it in kn?"),
    "speed through the water in cm/s named m/s": (
        lambda t: {**t, "surge [m/s]": 100.0 * t["surge [m/s]"]}, "is it in cm/s?"),
    "speeds in m/s named cm/s": (
        lambda t: {**t, "dvl_u [cm/s]": 0.01 * t["dvl_u [cm/s]"]}, "is it in m/s, not in cm/s?"),
    "shaft in radians a second named revolutions a minute": (
        lambda t: {**t, "n [rpm]": t["n [rpm]"] * np.pi / 30.0}, "times what this shaft speed gives"),
    "constant rudder": (lambda t: {**t, "rudder [deg]": 0.0 * t["rudder [deg]"] + 5.0}, "the rudder stays at 5.0 deg"),
    "three seconds of data": (lambda t: {name: values[:30] for name, values in t.items()}, "a fit needs 20 s"),
    "twelve seconds of data": (lambda t: {name: values[:125] for name, values in t.items()}, "12 s of data"),
    "a column of NaN": (lambda t: {**t, "heading [deg]": np.nan * t["time [s]"]}, "holds no number at all"),
    "reversed rudder": (lambda t: {**t, "rudder [deg]": -t["rudder [deg]"]}, "the vehicle turns against its rudder"),
    "reversed rudder without a gyro": (
        lambda t: without({**t, "rudder [deg]": -t["rudder [deg]"]}, "yaw_rate"), "sign: -1"),
    "reversed gyro": (lambda t: {**t, "yaw_rate [deg/s]": -t["yaw_rate [deg/s]"]}, "turn opposite ways"),
    "time that goes back": (
        lambda t: {**t, "time [s]": np.where(np.isclose(t["time [s]"], 40.0), 31.0, t["time [s]"])}, "sort the rows"),
    "no rudder": (lambda t: without(t, "rudder"), "no column is the rudder"),
    "no heading": (lambda t: without(t, "heading", "yaw_rate"), "no column is the heading or yaw rate"),
    "two headings": (lambda t: {**t, "psi [rad]": t["time [s]"]}, "are both heading"),
    "shaft that stands still": (lambda t: {**t, "n [rpm]": 0.0 * t["n [rpm]"]}, "the shaft stands still"),
    "a unit that is none": (lambda t: renamed(t, "surge [m/s]", "surge [furlong]"), "'furlong' is no unit of surge"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said_and_nothing_written(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command: exit code 2, one line with what is wrong, no folder."""
    spoil, said = WRONG[case]
    path = write(tmp_path / "log.csv", spoil(columns(synthetic(2))))
    assert cli.main(["identify", str(path), "--vehicle", "remus100", "--out", str(tmp_path / "out")]) == 2
    text = capsys.readouterr().err
    assert said in text
    assert text.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", ["multisine", "zigzag", "turns"])
def test_what_is_right_passes(kind: str, tmp_path: Path) -> None:
    """No detector is so sharp that it refuses a good log, of any manoeuvre, with few sensors or many."""
    table = columns(synthetic(3, 120.0, kind))
    slow = {**table, **{name: every(table[name], 50) for name in ("north [m]", "east [m]")}}
    few = without(table, "yaw_rate", "surge", "sway", "dvl_u", "dvl_v", "north", "east")
    for number, one in enumerate((table, slow, few)):
        checks.records(read([write(tmp_path / f"{number}.csv", one)]).records, TRUE)


@pytest.mark.parametrize("kind", ["zigzag", "turns"])
def test_knots_through_the_water_are_told_from_a_current(kind: str, tmp_path: Path) -> None:
    """On several headings the two surges of a log differ by the current's parts along them, and by a factor."""
    table = columns(synthetic(5, 120.0, kind))
    path = write(tmp_path / "knots.csv", {**table, "surge [m/s]": table["surge [m/s]"] * 3600 / 1852})
    with pytest.raises(InputError, match=r"is it in kn\?"):
        read([path])


def test_a_rudder_that_follows_the_yaw_rate_is_not_reversed(tmp_path: Path) -> None:
    """An autopilot's rudder goes against the yaw rate at each moment; by its effect it is right all the same."""
    table = columns(synthetic(4, 120.0, "zigzag"))
    path = write(tmp_path / "zigzag.csv", table)
    record = read([path]).records[0]
    now = np.corrcoef(record.inputs[:, 0], record.measured[:, 5])[0, 1]
    assert now < 0.95  # the response lags
    checks.records([record], TRUE)
    with pytest.raises(InputError, match="sign: -1"):
        checks.records(read([write(path, {**table, "rudder [deg]": -table["rudder [deg]"]})]).records, TRUE)


@pytest.mark.parametrize("turn", [0.0, 2.0, 19.0])
def test_a_circle_is_longer_than_from_place_to_place_and_knots_are_still_seen(turn: float) -> None:
    """A log of metres a second whose places close a circle of 8 m is right; of knots it is refused where it can be."""
    times = np.arange(0.0, 150.0, 0.1)
    heading, speed = np.radians(turn) * times, np.full(times.shape, 1.4)
    ways = np.cumsum(0.14 * np.exp(1j * heading))
    every_4 = slice(0, None, 40)  # places are rarer than the log's speeds
    places = {"north": ways.real[every_4], "east": ways.imag[every_4]}

    def given(factor: float) -> Signals:
        fast = {"heading": heading, "ground_surge": factor * speed}
        found = {name: Signal(times=times, values=values) for name, values in fast.items()}
        return Signals(
            name="log", signals=found | {n: Signal(times=times[every_4], values=v) for n, v in places.items()}
        )

    checks._speeds_and_positions(given(1.0))
    if turn < 10.0:
        with pytest.raises(InputError, match=r"1\.9\d times that of the positions: is it in kn"):
            checks._speeds_and_positions(given(3600.0 / 1852.0))
