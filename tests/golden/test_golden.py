"""Five trials against what they were before the rebuilding, and the tool that compares whole logs bit for bit."""

from pathlib import Path

import numpy as np
import pytest

from . import compare, stored
from .cases import CASES, run

# Absolute, in SI units. Another processor's BLAS and mathematical library differ in the last digit of each operation.
# With OpenBLAS's oldest kernels (OPENBLAS_CORETYPE=Nehalem) and Numba's code for a generic processor, what is kept
# here moves by at most 4e-10 (impulse of a contact) and 1e-11 (all else); a start shifted by 1e-12 m and deg moves it
# by 9e-10 and 3e-11. The tolerance leaves a hundredfold of that. An unstable simulation amplifies its own rounding
# errors: there those kernels make 1e-7, and shifts of 1e-12 to 1e-11 up to 2e-5.
TOLERANCES = {name: 1e-3 if name == "diverging" else 1e-7 for name in CASES}
FORMATS = Path(__file__).parent
AT = "vehicles/remus100/"


@pytest.fixture(scope="module", params=CASES)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def kept(name: str, folder: Path, shift: float = 0.0) -> dict[str, np.ndarray]:
    """What would be kept of a case as it runs now."""
    run(CASES[name], folder / "log.nc", shift=shift)
    return stored.part(compare.load(folder / "log.nc"))


def outside(now: dict[str, np.ndarray], before: dict[str, np.ndarray], tolerance: float) -> list[str]:
    """The variables that differ: numbers by more than a tolerance; phases, kinds and counts at all."""
    assert now.keys() == before.keys()
    found = []
    for path, value in before.items():
        same_shape = now[path].shape == value.shape
        if value.dtype.kind == "f":
            same = same_shape and np.allclose(now[path], value, rtol=0.0, atol=tolerance, equal_nan=True)
        else:
            same = same_shape and (now[path] == value).all()
        if not same:
            found.append(path)
    return found


def test_case_is_what_it_was(name: str, tmp_path: Path):
    assert outside(kept(name, tmp_path), stored.read(name), TOLERANCES[name]) == []


def test_tolerance_lets_rounding_pass_and_nothing_else(name: str, tmp_path: Path):
    """A start shifted by as much as rounding errors add up to passes; one shifted by 100 tolerances does not."""
    before, tolerance = stored.read(name), TOLERANCES[name]
    assert outside(kept(name, tmp_path, shift=1e-12), before, tolerance) == []
    shifted = kept(name, tmp_path, shift=100.0 * tolerance)
    assert "truth/position" in outside(shifted, before, tolerance)
    moved = np.linalg.norm(shifted["truth/position"][0] - before["truth/position"][0])
    turned = np.degrees(shifted["truth/attitude"][0, 2] - before["truth/attitude"][0, 2])
    assert (moved, turned) == pytest.approx((100.0 * tolerance,) * 2, rel=1e-3)  # 1e-5 of numbers of 100: 1e-9 at best


def test_cases_show_what_they_are_for():
    """Each case would be worth nothing if it did not go through what it is named after."""
    events = {name: stored.read(name)["event/kind"].tolist() for name in CASES}
    assert [name for name in CASES if "docked" in events[name]] == ["docking", "turning", "outliers"]
    assert events["turning"].count("go_around") >= 1
    assert stored.read("turning")["mission/attempt"][-1] == 2
    assert events["diverging"][-1] == "diverged"
    zigzag = stored.read("zigzag")
    assert np.isfinite(zigzag["sensors/dvl/value"]).any()
    assert len(zigzag["sensors/gyro/value"]) > 0
    assert np.ptp(np.sign(zigzag["command/rudder"])) == 2.0  # to both sides
    outliers = stored.read("outliers")
    received = outliers["sensors/usbl/received"][np.isfinite(outliers["sensors/usbl/received"])]
    assert (np.diff(received) < 0.0).any()  # out of order
    assert outliers["sensors/usbl/outlier"].sum() > 0.1 * len(received)
    # Of 27 refusals 15 are for packets that arrived twice; outliers alone would be 12.
    assert outliers["estimate/refused"][-1] > outliers["sensors/usbl/outlier"].sum()


@pytest.mark.parametrize("file", ["format1/docking.nc", "format2/docking.nc", "format2/zigzag.nc"])
def test_kept_logs_are_of_their_version(file: str):
    contents = compare.load(FORMATS / file)
    assert contents[compare.VERSION] == int(file[6])
    assert (AT + "sensors/dvl/value" in contents) == (file[6] == "2")
    assert AT + "truth/ned" not in contents  # a dimension, which holds nothing
    assert (len(contents[AT + "contact/force"]) > 100) == ("docking" in file)


@pytest.fixture(scope="module")
def old() -> compare.Contents:
    return compare.load(FORMATS / "format2" / "docking.nc")


def test_one_bit_is_seen(old: compare.Contents):
    """In a number, in a count, in a text; also the sign of a zero. What the wall clock says is not."""
    assert compare.differences(old, old | {"@wall_time": np.asarray(1.0), "@numpy_version": np.asarray("0")}) == []
    for path in (AT + "truth/position", AT + "estimate/covariance", AT + "sensors/usbl/sequence"):
        other = old[path].copy()
        other.view(np.uint8).flat[-other.itemsize] ^= 1
        (line,) = compare.differences(old, old | {path: other})
        assert line.startswith(f"{path}: 1 of {len(other)} rows differ, from row {len(other) - 1}")
    text = old["event/kind"].copy()
    text[0] = "other"
    assert len(compare.differences(old, old | {"event/kind": text})) == 1
    zeros = {path: np.zeros(3) for path in ("a", "b")}
    assert len(compare.differences(old | zeros, old | zeros | {"b": -zeros["b"]})) == 1
    assert len(compare.differences(old, old | {"@seed": np.asarray(99)})) == 1
    assert (
        len(
            compare.differences(old, old | {AT + "sensors/depth/value": old[AT + "sensors/depth/value"].view(np.int64)})
        )
        == 1
    )


def test_what_is_only_in_one_is_seen(old: compare.Contents):
    less = {path: value for path, value in old.items() if path != AT + "command/rudder"}
    assert compare.differences(old, less) == [AT + "command/rudder: only in the first"]
    assert compare.differences(less, old) == [AT + "command/rudder: only in the second"]


def test_what_is_new_or_changed_counts_only_between_formats(old: compare.Contents):
    """A later format may have groups of its own, and holds some things otherwise; logs of one format may not differ."""
    new = old | {compare.VERSION: np.asarray(3), "@scenario": np.asarray("vehicles: {}")}
    new |= {"network/messages/time": np.zeros(2), AT + "measurements/nis": np.ones(3)}
    assert compare.differences(old, new) == []
    assert compare.differences(old, new | {"networks": np.zeros(1)}) == ["networks: only in the second"]
    assert compare.differences(new, new | {"network/messages/time": np.ones(2)}) != []


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture):
    """Exit code 0 for equal folders, 1 if a file differs or is missing, 2 for a wrong command."""
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        run(CASES["diverging"], tmp_path / folder / "log.nc")
    pair = [str(tmp_path / "a"), str(tmp_path / "b")]
    assert compare.main(pair) == 0
    assert capsys.readouterr().out == "log.nc: equal\n"
    run(CASES["diverging"], tmp_path / "b" / "log.nc", shift=1e-12)
    assert compare.main(pair) == 1
    assert "truth/nu: " in capsys.readouterr().out
    (tmp_path / "b" / "log.nc").unlink()
    assert compare.main(pair) == 1
    assert compare.main([]) == 2
