"""Inputs that ended in a traceback or in a run without end: one line each, exit code 2, nothing left behind."""

import errno
import os
import signal
import time
from pathlib import Path

import pytest

from auvsim import cli
from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.base.settings import LARGEST, OTHERWISE, TINY
from auvsim.cli import main, products
from auvsim.simulation import sampling, scenario

LONG = "x" * 300


def refused(capsys: pytest.CaptureFixture, *arguments: str) -> str:
    """The one line with which the command line refuses arguments, within seconds."""
    begin = time.process_time()
    assert main(list(arguments)) == 2
    assert time.process_time() - begin < 20.0  # of CPU time: with what it imports
    *before, error = capsys.readouterr().err.splitlines()
    assert all(line.startswith("compiling ") for line in before)  # once, on a machine that has not yet
    assert error.startswith("auvsim: ")
    return error


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("seed", "99999999999999999999999999", "both must be whole numbers >= 0 and below 2^63"),
        ("seed", str(2**63), "both must be whole numbers >= 0 and below 2^63"),
        ("trial", "-1", "both must be whole numbers >= 0 and below 2^63"),
        ("vehicle.start.range", "{uniform: [-1e308, 1e308]}", "-1e+308 is too large; numbers are at most 1e+12"),
        ("vehicle.start.range", "{normal: [0, 1e300]}", "1e+300 is too large"),
        ("vehicle.start.range", "{truncated_normal: [0, 1, -1e13, 1]}", "-1e+13 is too large"),
        ("vehicle.start.range", "1e6", "vehicle.start.range: 1000000.0 should be less than or equal to 100000"),
        ("vehicle.start.depth", "13000", "vehicle.start.depth: 13000 should be less than or equal to 12000"),
        ("vehicle.start.speed", "21", "vehicle.start.speed: 21 should be less than or equal to 20"),
        ("vehicle.start.heading_deg", "1e5", "vehicle.start.heading_deg: 100000 should be at most 3600 in size [deg]"),
        ("dock.north", "-1e7", "dock.north: -1e+07 should be at most 1e+06 in size [m]"),
        ("duration", "1e12", "should be less than or equal to 1000000"),
        ("rates.physics", "1e9", "should be less than or equal to 10000"),
        ("rates.control", "1e-6", "should be greater than or equal to 0.01"),
        ("sensors.usbl.interval", "1e-6", "should be greater than or equal to 0.05"),
        ("sensors.usbl.near_interval", "0.001", "should be greater than or equal to 0.05"),
        ("sensors.usbl.noise", "[[12, 1e9]]", "sensors.usbl.noise: 1e+09 should be at most 1e+06 in size [m]"),
        ("sensors.usbl.transceiver", "[0, 1e-12, 0]", "1e-12 should be 0 or at least 1e-09 in size [m]"),
        ("current", "{kind: gust, correlation_time: 1e-6}", "should be greater than or equal to 0.1"),
        ("current", "{kind: uniform, speed: 200}", "current.speed: 200 should be at most 100 in size [m/s]"),
        ("world.water_density", "13", "should be greater than or equal to 900"),
        ("guidance.lookahead", "1e-300", "guidance.lookahead: 1e-300 should be 0 or at least 1e-09 in size [m]"),
        ("guidance.attempts", "100000000000", "should be less than or equal to 1000"),
        ("estimator.model_speed", "1e-5", "should be greater than or equal to 0.05"),
        ("vehicle.model", LONG, "no vehicle 'xxxx"),
        ("vehicle.model", "../dock/dock", "no vehicle '../dock/dock'; there are"),
        ("vehicle.model", f"{LONG}.xml", "File name too long"),
        ("estimator.model", LONG, "no planar model 'xxx"),
        ("out", LONG, "cannot be written to: file name too long"),
    ],
)
def test_a_value_beyond_its_bounds_is_refused(tmp_path, monkeypatch, capsys, key: str, value: str, says: str) -> None:
    """With its key and its bounds."""
    monkeypatch.chdir(tmp_path)
    assert says in refused(capsys, "dock", "--no-video", f"--{key}={value}")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("manoeuvre spiral --manoeuvre.step_deg 1e-6", "should be greater than or equal to 0.1"),
        ("manoeuvre multisine --manoeuvre.lowest 1e-9", "should be greater than or equal to 0.0001"),
        ("manoeuvre prbs --manoeuvre.clock 1e-7", "should be greater than or equal to 0.01"),
        (f"video {LONG}", "File name too long"),
        (f"dock {LONG}.yaml", "ile name too long"),
        (f"campaign {LONG}", "File name too long"),
        ("video trial.nc --still x.png --time nan", "--time nan: give a finite number that is not negative"),
        ("video trial.nc --still x.png --time inf", "--time inf: give a finite number that is not negative"),
        ("video trial.nc --speed nan", "--speed nan: give a finite number that is not negative"),
    ],
)
def test_arguments_of_other_commands(tmp_path, monkeypatch, capsys, arguments: str, says: str) -> None:
    """Likewise."""
    monkeypatch.chdir(tmp_path)
    assert says in refused(capsys, *arguments.split())
    assert not any(tmp_path.iterdir())


def test_a_gust_of_more_knots_than_memory_is_refused() -> None:
    """Within both bounds alone, not together: 10^6 s of 0.1 s would be 2 * 10^8 knots."""
    from auvsim.simulation.building import current

    values = {"duration": 1e6, "current": {"kind": "gust", "correlation_time": 0.1}}
    with pytest.raises(InputError, match=r"give at least 10 s, or a shorter duration"):
        current(scenario.parse(values), 0)


def test_bounds_hold_at_their_ends() -> None:
    """The largest sizes themselves, and zero, are taken; the next number is not."""
    for unit, key in (("m", "dock.north"), ("deg", "dock.heading_deg")):
        *above, last = key.split(".")
        for value in (LARGEST[unit], -LARGEST[unit], TINY, 0.0):
            assert scenario.parse({above[0]: {last: value}})
        for value in (LARGEST[unit] * (1 + 1e-15), TINY * (1 - 1e-15)):
            with pytest.raises(InputError):
                scenario.parse({above[0]: {last: value}})
    noise = {"estimator": {"position_noise": 1e-30}}  # of another unit: may be as small as it likes
    assert scenario.parse(noise)
    with pytest.raises(InputError, match="at most 1e\\+12 in size"):
        scenario.parse({"estimator": {"position_noise": OTHERWISE * 1.01}})


def test_seeds_that_a_log_can_hold() -> None:
    """The largest is taken."""
    assert stream(2**63 - 1, 2**63 - 1, "a").random() < 1.0
    with pytest.raises(InputError):
        stream(0, 2**63, "a")


def bomb(levels: int) -> str:
    """YAML of 10^levels values, by aliases."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, levels)]
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (bomb(8), "bad.yaml:6: more than 200000 values, aliases written out"),
        (bomb(60), "bad.yaml:6: more than 200000 values, aliases written out"),
        (f"a: {'[' * 5000}{']' * 5000}", "bad.yaml: not YAML: values are nested too deeply"),
        ("a: &a [1, *a]", "bad.yaml:1: not YAML: a value contains itself"),
        ("duration: 1\na: &a\n  b: {c: *a}", "bad.yaml:2: not YAML: a value contains itself"),
        ("duration: " + "9" * 5000, "bad.yaml: not YAML: "),
    ],
)
def test_yaml_that_explodes_is_refused(tmp_path, monkeypatch, capsys, text: str, says: str) -> None:
    """In little time, with the line."""
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text(text)
    assert says in refused(capsys, "dock", "bad.yaml")


def test_aliases_that_do_no_harm_are_read() -> None:
    """Their places, too."""
    read = yaml_text.read("a: &a {x: 1, y: [2, 3]}\nb: *a\nc: [*a, *a]")
    assert read.value == {"a": (one := {"x": 1, "y": [2, 3]}), "b": one, "c": [one, one]}
    assert read.places["c.1.y.0"].endswith(":1")


@pytest.mark.parametrize("full", ["summary", "plots"])
def test_a_disk_that_is_full_after_the_log(tmp_path, monkeypatch, capsys, full: str) -> None:
    """The log stays; the line says what makes the rest."""

    def write(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(tmp_path / "summary.json"))

    monkeypatch.setattr(products, full, write)
    assert main(["dock", "--no-video", "--duration", "1", "--out", str(tmp_path)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "summary.json: cannot be written: no space left on device; " in line
    assert f"{tmp_path / 'trial.nc'} is whole, `auvsim metrics`" in line
    assert (tmp_path / "trial.nc").is_file()


@pytest.mark.parametrize("error", [RuntimeError, SystemError, OSError, ValueError])
def test_ctrl_c_that_compiled_code_turns_into_another_error(monkeypatch, capsys, error: type[Exception]) -> None:
    """130, as of any interruption; the same error without Ctrl-C is what it was."""

    def work(arguments: list[str]) -> int:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise error("an exception was set in compiled code") from None
        return 0

    monkeypatch.setattr(cli, "_run", work)
    before = signal.getsignal(signal.SIGINT)
    assert main([]) == 130
    assert capsys.readouterr().err == "auvsim: interrupted\n"
    assert signal.getsignal(signal.SIGINT) is before

    def fail(arguments: list[str]) -> int:
        raise error("of its own")

    monkeypatch.setattr(cli, "_run", fail)
    if error is OSError:
        assert main([]) == 2
        return
    with pytest.raises(error, match="of its own"):
        main([])


def test_out_of_memory_is_one_line(monkeypatch, capsys) -> None:
    """Exit code 1."""

    def fail(arguments: list[str]) -> int:
        raise MemoryError("Unable to allocate 768. GiB")

    monkeypatch.setattr(cli, "_run", fail)
    assert main([]) == 1
    assert capsys.readouterr().err == "auvsim: out of memory: Unable to allocate 768. GiB\n"


def test_the_default_plan_is_within_all_bounds() -> None:
    """A hundred draws of it."""
    for seed in range(100):
        scenario.parse(sampling.draw(sampling.default_plan(), seed))
