"""Whatever is put in: an exit code of the four, one line, no traceback, nothing half-written, bounded time.

Scenarios and plans are drawn key by key from the schema, with values that are right, at a bound, beyond it, or of
another type; numerics of an MJCF file and bytes of a log are spoiled at random. What passes the checks runs for a
second of simulated time.
"""

import contextlib
import io
import math
import re
import time
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.campaign import plan as plans
from auvsim.cli import main
from auvsim.data import log
from auvsim.identification import readers
from auvsim.physics import soundness
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run
from auvsim.simulation.short import ShortScenario
from robustness.models import text as model_text

CODES = (0, 1, 2, 130)
MOST = 20.0  # CPU time of one command [s]; a second of simulated time takes 0.05, imports and compilation come once
KEYS = sorted(key for key in schema.keys(ShortScenario) if not key.startswith(("duration", "mission.", "manoeuvre")))
NUMERICS = re.findall(r'<numeric name="(\w+)"', model_text("vehicle"))

CI = settings(max_examples=100, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
SLOW = settings(max_examples=2000, deadline=None, suppress_health_check=list(HealthCheck))

numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-(10**30), 10**30),
    st.sampled_from([0, 1, -1, 0.0, 1e-300, 1e-9, 1e9, 1e308, -1e308, 1e6, 3600.0, 100.0, 20.0, 10.0, 0.5]),
)
plain = st.one_of(numbers, st.none(), st.booleans(), st.text(max_size=20))
distributions = st.one_of(
    st.builds(lambda name, values: {name: values},
              st.sampled_from(["uniform", "normal", "log_uniform", "truncated_normal", "choice"]),
              st.lists(plain, max_size=5)),
)  # fmt: skip
values = st.one_of(
    plain, distributions, st.lists(plain, max_size=4), st.dictionaries(st.text(max_size=8), plain, max_size=2)
)


def nested(pairs: list[tuple[str, Any]]) -> dict:
    """Nested values of dotted keys; where two contradict each other the later one stands."""
    whole: dict = {}
    for key, value in pairs:
        below = whole
        *above, last = key.split(".")
        for part in above:
            if not isinstance(below.get(part), dict):
                below[part] = {}
            below = below[part]
        below[last] = value
    return whole


def command(folder: Path, *arguments: str) -> tuple[int, str]:
    """Exit code and last line of errors of a command, checked for all that always holds."""
    errors, begin = io.StringIO(), time.process_time()
    # Pictures take most of the time of so short a run; tests of their own draw odd logs.
    with (
        mock.patch("auvsim.cli.products.plots"),
        contextlib.redirect_stderr(errors),
        contextlib.redirect_stdout(io.StringIO()),
    ):
        code = main(list(arguments))
    spent, said = time.process_time() - begin, errors.getvalue()
    assert code in CODES
    assert spent < MOST
    assert "Traceback" not in said
    lines = [line for line in said.splitlines() if line.startswith("auvsim: ")]
    assert len(lines) == (code != 0), said
    assert not [*folder.rglob(".*partial*")]
    return code, lines[-1] if lines else ""


def spoil_scenario(folder: Path, pairs: list[tuple[str, Any]]) -> None:
    """Runs `auvsim dock` with a file of these values."""
    path = folder / "scenario.yaml"
    path.write_text(yaml_text.dump(nested([("duration", 1.0), *pairs])), encoding="utf-8")
    code, line = command(folder, "dock", str(path), "--no-video", "--out", str(folder / "out"))
    if code == 2:
        assert len(line) < 2000
        assert not (folder / "out").exists()
    else:
        assert log.read(folder / "out" / "trial.nc").attributes["status"] in ("complete", "diverged")


def spoil_plan(pairs: list[tuple[str, Any]], extra: dict) -> None:
    """Reads a plan of these values; nothing runs."""
    begin = time.process_time()
    with contextlib.suppress(InputError):
        plans.parse({"trials": 1, "base": nested(pairs)} | extra)
    assert time.process_time() - begin < MOST


def spoil_model(folder: Path, name: str, values: list[float], count: int, *, sails: bool) -> None:
    """Checks a vehicle one of whose numerics has other numbers, or runs `auvsim dock` with it."""
    found = re.search(rf'(<numeric name="{name}" data=")([^"]*)(")', whole := model_text("vehicle"))
    assert found is not None
    data = found.group(2).split()
    data = data[:count] if count < len(data) else data
    for index, value in enumerate(values[: len(data)]):
        data[index] = repr(value)
    path = folder / "mine.xml"
    path.write_text(
        whole.replace(found.group(0), f"{found.group(1)}{' '.join(data)}{found.group(3)}"), encoding="utf-8"
    )
    if not sails:  # what the checks let pass can be stepped
        with contextlib.suppress(InputError):
            soundness.check(str(path), 1026.0)
            soundness.check_step(str(path), "implicitfast", 100.0, 1026.0)
        return
    out = ("--no-video", "--out", str(folder / "out"), "--duration", "1")
    command(folder, "dock", "--vehicle.model", str(path), *out)


@pytest.fixture(scope="module")
def whole_log() -> bytes:
    """Bytes of a short log."""
    return log.pack(run(scenario.parse(sampling.draw(sampling.merge(sampling.default_plan(), {"duration": 3.0}), 1))))


def spoil_log(folder: Path, whole: bytes, changes: list[tuple[float, int]], end: float) -> None:
    """Reads a log some of whose bytes are others, or whose end is missing: the log, or one line."""
    content = bytearray(whole[: max(1, round(end * len(whole)))])
    for place, value in changes:
        content[min(int(place * len(content)), len(content) - 1)] = value
    path = folder / "spoiled.nc"
    path.write_bytes(content)
    begin = time.process_time()
    with contextlib.suppress(InputError):
        log.read(path)
    assert time.process_time() - begin < MOST


def table() -> bytes:
    """A CSV log of 40 s at 5 Hz: a rudder that steps to and fro, and a heading that follows."""
    lines = ["time [s],rudder [deg],n [rpm],heading [deg],u [m/s]"]
    heading = 0.0
    for k in range(200):
        rudder = 10.0 if (k // 40) % 2 else -10.0
        heading += 0.1 * rudder
        lines.append(f"{0.2 * k:.1f},{rudder:.1f},900,{heading % 360.0:.2f},1.5{k % 7}")
    return "\n".join(lines).encode()


def spoil_table(
    folder: Path, changes: list[tuple[float, int]], cells: list[tuple[float, int, str]], end: float
) -> None:
    """Reads a CSV log some of whose cells and bytes are others, or whose end is missing: records, or one line."""
    rows = [line.split(",") for line in table().decode().splitlines()]
    for place, column, text in cells:
        rows[min(int(place * len(rows)), len(rows) - 1)][column] = text
    whole = "\n".join(",".join(row) for row in rows).encode("utf-8", "surrogatepass")
    content = bytearray(whole[: max(1, round(end * len(whole)))])
    for place, value in changes:
        content[min(int(place * len(content)), len(content) - 1)] = value
    path = folder / "spoiled.csv"
    path.write_bytes(content)
    begin = time.process_time()
    with contextlib.suppress(InputError):
        readers.read([path], vehicle="remus100")
    assert time.process_time() - begin < MOST


pairs = st.lists(st.tuples(st.sampled_from(KEYS), values), min_size=1, max_size=3)
extras = st.dictionaries(
    st.sampled_from(["name", "seed", "trials", "grid", "variants", "stop", "timeout", "keep"]), values, max_size=2
)
shares = st.floats(0.0, 1.0)
changed = st.lists(st.tuples(shares, st.integers(0, 255)), max_size=8)
ends = st.one_of(st.just(1.0), shares)
texts = st.one_of(numbers.map(str), st.text(max_size=8), st.sampled_from(["", "NaN", "-9999", "1e35", "0,5", "12:30"]))
cells = st.lists(st.tuples(shares, st.integers(0, 4), texts), max_size=5)
finite_or_not = st.lists(st.floats() | st.sampled_from([0.0, -1.0, 1e-12, 1e12, math.nan]), min_size=1, max_size=6)


@pytest.fixture
def folders(tmp_path_factory: pytest.TempPathFactory):
    """Makes a new folder for each example."""
    return lambda: tmp_path_factory.mktemp("example")


@CI
@given(pairs)
def test_scenarios(folders, found) -> None:
    """Any key with any value."""
    spoil_scenario(folders(), found)


@CI
@given(pairs, extras)
def test_plans(found, extra) -> None:
    """Any key of the base with any value, and the plan's own keys too."""
    spoil_plan(found, extra)


@CI
@given(st.sampled_from(NUMERICS), finite_or_not, st.integers(0, 40))
def test_models(folders, name, found, count) -> None:
    """Any numeric of the vehicle with other numbers, or with fewer: its checks end in nothing or in one line."""
    spoil_model(folders(), name, found, count, sails=False)


@CI
@given(changed, ends)
def test_logs(folders, whole_log, changes, end) -> None:
    """Any bytes of a log changed, any end cut off."""
    spoil_log(folders(), whole_log, changes, end)


@CI
@given(changed, cells, ends)
def test_tables(folders, changes, found, end) -> None:
    """Any cells and bytes of a CSV log changed, any end cut off."""
    spoil_table(folders(), changes, found, end)


@pytest.mark.slow
@SLOW
@given(changed, cells, ends)
def test_many_tables(folders, changes, found, end) -> None:
    """As above."""
    spoil_table(folders(), changes, found, end)


@pytest.mark.parametrize("stamp", ["-5.764607523034234e+17", "-7.205759403792791e+16", "1e12"])
def test_a_stamp_of_another_age(tmp_path, stamp: str) -> None:
    """Its record would not fit into memory."""
    spoil_table(tmp_path, [], [(0.5, 0, stamp)], 1.0)


def test_a_lift_that_no_fit_bears(tmp_path) -> None:
    """Its planar model has no steady turn."""
    spoil_model(tmp_path, "rudder_lower_lift_slope", [1e12], 16, sails=True)


@pytest.mark.slow
@SLOW
@given(pairs)
def test_many_scenarios(folders, found) -> None:
    """As above."""
    spoil_scenario(folders(), found)


@pytest.mark.slow
@SLOW
@given(pairs, extras)
def test_many_plans(found, extra) -> None:
    """As above."""
    spoil_plan(found, extra)


@pytest.mark.slow
@SLOW
@given(st.sampled_from(NUMERICS), finite_or_not, st.integers(0, 40))
def test_many_models(folders, name, found, count) -> None:
    """As above, and what passes the checks sails."""
    spoil_model(folders(), name, found, count, sails=True)


@pytest.mark.slow
@SLOW
@given(changed, ends)
def test_many_logs(folders, whole_log, changes, end) -> None:
    """As above."""
    spoil_log(folders(), whole_log, changes, end)
