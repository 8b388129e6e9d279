"""Models that are wrong without being broken: each is refused in one line that says what would be right."""

from dataclasses import replace
from pathlib import Path

import pytest

from auvsim.base.errors import InputError
from auvsim.cli import main
from auvsim.physics import planar_sets, soundness
from auvsim.physics.forces import RECORD
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.vehicles import library
from estimators.planar.model import PRESTERO
from robustness.models import spoiled

ALLOCATION = '<numeric name="allocation_rudder" data="1 1 0 0"/>'
ELEVATOR = '<numeric name="allocation_elevator" data="0 0 1 1"/>'
FINS = 'ctrlrange="-0.2618 0.2618"'
SHAFT = 'ctrlrange="-159.7 159.7"'
VOLUME = 'data="0.0302437"'


def refused(capsys: pytest.CaptureFixture, out: Path, *arguments: str) -> str:
    """The one line with which `auvsim dock` refuses what is given; it leaves no folder."""
    assert main(["dock", "--no-video", "--out", str(out), *arguments]) == 2
    *before, error = capsys.readouterr().err.splitlines()
    assert all(line.startswith("compiling ") for line in before)  # once, on a machine that has not yet
    assert not out.exists()
    return error


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('<compiler angle="radian"/>', "", 'give <compiler angle="radian"/>'),
        ('<compiler angle="radian"/>', '<compiler angle="degree"/>', 'give <compiler angle="radian"/>'),
        ('<compiler angle="radian"/>', '<compiler autolimits="true"/>', 'give <compiler angle="radian"/>'),
        (ALLOCATION, ALLOCATION.replace("1 1", "-1 -1"), "a positive rudder must be one that turns to starboard"),
        (ELEVATOR, ELEVATOR.replace("1 1", "-1 -1"), "a positive elevator must be one that dives"),
        (ALLOCATION, ALLOCATION.replace("1 1", "1 -1.001"), "a positive rudder must be one that turns to starboard"),
        ("0.4566 -0.4174", "-0.4566 -0.4174", "a positive shaft speed must drive ahead"),
        (SHAFT, 'ctrlrange="0 0"', "the limits of 'shaft' are 0 and 0; they must enclose 0"),
        (FINS, 'ctrlrange="0 0"', "the limits of 'rudder_upper' are 0 and 0; they must enclose 0"),
        (FINS, 'ctrlrange="nan nan"', "the limits of 'rudder_upper' are nan and nan; they must enclose 0"),
        (VOLUME, 'data="0.302437"', "correct hull_displaced_volume or the masses"),
        (VOLUME, 'data="0.0151"', "correct hull_displaced_volume or the masses"),
        (VOLUME, 'data="30.2437"', "correct hull_displaced_volume or the masses"),
        (ALLOCATION, ALLOCATION.replace("1 1 0 0", "1 1"), "'allocation_rudder' has 2 numbers; it wants 4"),
        (ALLOCATION, ALLOCATION.replace("1 1 0 0", "1 1 0 nan"), "the numeric 'allocation_rudder' is"),
        (ELEVATOR, ELEVATOR.replace("1 1", "0 inf"), "the numeric 'allocation_elevator' is"),
        (f'nuser_body="{RECORD}"', 'nuser_body="10"', "nuser_body"),
        ('model="remus100"', 'model="a/b"', 'model="a/b": give a name of 1 to 64 letters'),
        ('model="remus100"', 'model="Tümmler"', "give a name of 1 to 64 letters"),
        ('model="remus100"', f'model="{"x" * 300}"', "give a name of 1 to 64 letters"),
        ('<velocity name="shaft"', '<velocity name="motor"', "lacks the actuator 'shaft'"),
        ('name="hull_', 'name="hul_', "names no body"),
    ],
)
def test_a_vehicle_that_cannot_be_right_is_refused(tmp_path, capsys, old, new, says) -> None:
    """By what its compiled model does, or its file says."""
    path = spoiled(tmp_path, "vehicle", (old, new))
    assert says in refused(capsys, tmp_path / "out", "--vehicle.model", path)


def test_a_vehicle_of_the_docks_name_runs(tmp_path: Path) -> None:
    """A vehicle and a structure of one name are told apart, or the line says which name is used twice."""
    path = spoiled(tmp_path, "vehicle", ('model="remus100"', 'model="dock"'))
    code = main(["dock", "--no-video", "--duration", "1", "--out", str(tmp_path / "out"), "--vehicle.model", path])
    assert code in (0, 2)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('<site name="mouth" pos="0 0 0"', '<site name="gate" pos="0 0 0"', "lacks the site 'mouth'"),
        ('<site name="mouth" pos="0 0 0"', '<site name="mouth" pos="0.2 0 0"', "the site 'mouth' must be the origin"),
        ('"mouth_radius" data="0.75"', '"mouth_radius" data="-0.5"', "'mouth_radius' is [-0.5]; it must be one number"),
        ('"mouth_radius" data="0.75"', '"mouth_radius" data="nan"', "'mouth_radius' is [nan]; its data must be finite"),
        ('"throat_radius" data="0.15"', '"throat_radius" data="0"', "'throat_radius' is [0.0]; it must be one number"),
        ('"throat_radius" data="0.15"', '"throat_radius" data="0.8"', "throat_radius 0.8 m is more than mouth_radius"),
        ('"cone_length" data="1.03923"', '"cone_length" data="1 2"', "'cone_length' is [1.0, 2.0]; it must be one"),
        ('"latched" pos="1.28923', '"latched" pos="-1.28923', "the site 'latched' is -1.28923 m behind the mouth"),
        ('"latched" pos="1.28923', '"latched" pos="2.5', "the site 'latched' is 2.5 m behind the mouth"),
    ],
)
def test_a_dock_that_cannot_be_right_is_refused(tmp_path, capsys, old, new, says) -> None:
    """A mouth that is missing, elsewhere, or of no size; a latch where no vehicle can be."""
    path = spoiled(tmp_path, "structure", (old, new))
    assert says in refused(capsys, tmp_path / "out", "--dock.model", path)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("--dock.depth 60", "dock.depth: 60 m is not between the surface and the sea floor at 40 m"),
        ("--world.sea_floor 15", "dock.depth: 20 m is not between the surface and the sea floor at 15 m"),
        ("--dock.depth 0.3", "a mouth of radius 0.75 m at a depth of 0.3 m is not wholly between"),
        ("--dock.depth 39.5", "give a depth between 0.75 and 39.25 m"),
        ("--dock.depth -3", "dock.depth: -3 should be greater than 0"),
        ("--vehicle.start.depth 41", "start.depth: 41 m is not between the surface and the sea floor at 40 m"),
        ("--vehicle.start.depth 0", "start.depth: 0 m is not between the surface and the sea floor at 40 m"),
    ],
)
def test_what_is_not_in_the_water_is_refused(tmp_path, capsys, arguments, says) -> None:
    """Docks and vehicles below the floor or out of the water."""
    assert says in refused(capsys, tmp_path / "out", *arguments.split())


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        (replace(PRESTERO, m=-31.0), "m is -31; it must be above 0"),
        (replace(PRESTERO, I_z=0.0), "I_z is 0; it must be above 0"),
        (replace(PRESTERO, Y_vd=40.0), "m - Y_vd is -9.52; it must be above 0"),
        (replace(PRESTERO, x_g=3.0), "inertia in sway and yaw"),
        (replace(PRESTERO, X_uu=1.62), "X_uu 1.62"),
    ],
)
def test_parameters_of_no_vehicle_are_refused(tmp_path, capsys, parameters, says) -> None:
    """Masses that are not positive, and drag that drives."""
    found = planar_sets.PlanarSet(
        vehicle="remus100", speed=1.5, method="by hand", start="nothing", version="0", sources=(),
        parameters=planar_sets.coefficients(parameters, {}),
    )  # fmt: skip
    planar_sets.write(found, tmp_path / "mine.yaml")
    with pytest.raises(InputError, match=str(tmp_path)) as caught:
        planar_sets.load(str(tmp_path / "mine.yaml"), "remus100")
    assert says in str(caught.value)
    assert says in refused(capsys, tmp_path / "out", "--estimator.model", str(tmp_path / "mine.yaml"))


def test_a_step_too_long_for_the_servos_is_refused() -> None:
    """RK4 is stable while its step is below 2.785 times the fastest time constant.

    The shipped servo's poles are those of 0.02 s^2 + 2 s + 20, the faster at -88.7 1/s: 31.9 Hz. A stiffer servo of
    twice the rate constants needs twice the rate.
    """
    slowest = 88.73 / 2.785  # [Hz]
    soundness.check_step("remus100", "RK4", 1.02 * slowest, 1026.0)
    with pytest.raises(InputError, match=r"rates.physics: 31.2\d* Hz is too slow for .*; 62.4\d* Hz is fast enough"):
        soundness.check_step("remus100", "RK4", 0.98 * slowest, 1026.0)
    with pytest.raises(InputError, match=r"20 Hz is too slow .* with RK4, .* 40 Hz is fast enough"):
        soundness.check_step("remus100", "RK4", 20.0, 1026.0)
    # The default integrator is implicit in the servos: what limits it is the damping by the water.
    soundness.check_step("remus100", "implicitfast", 20.0, 1026.0)
    with pytest.raises(InputError, match=r"rates\.physics: 5 Hz is too slow"):
        soundness.check_step("remus100", "implicitfast", 5.0, 1026.0)


def test_a_stiffer_servo_needs_a_shorter_step(tmp_path: Path) -> None:
    """Inertia of a quarter: poles of 0.005 s^2 + 2 s + 20, the faster at -389.7 1/s, 140 Hz for RK4."""
    path = spoiled(tmp_path, "vehicle", ('damping="2" armature="0.02"', 'damping="2" armature="0.005"'))
    slowest = 389.7 / 2.785
    soundness.check_step(path, "RK4", 1.02 * slowest, 1026.0)
    with pytest.raises(InputError, match="is too slow for the servos or the damping"):
        soundness.check_step(path, "RK4", 0.98 * slowest, 1026.0)


def test_a_refused_step_leaves_nothing(tmp_path, capsys) -> None:
    """The row itself: 20 Hz with RK4."""
    rates = ("--rates.physics", "20", "--world.integrator", "RK4")
    assert "rates.physics: 20 Hz is too slow" in refused(capsys, tmp_path / "out", *rates)


def test_a_model_that_changed_is_read_again(tmp_path: Path) -> None:
    """Within one process: by the text of the file, not by its name."""
    path = spoiled(tmp_path, "vehicle", ('"0.4566 -0.4174"', '"0.4566 -0.4174"'))
    before = fit_planar_model(path, 1.5).shaft_speed
    spoiled(tmp_path, "vehicle", ('"0.4566 -0.4174"', '"0.9132 -0.4174"'))
    after = fit_planar_model(path, 1.5).shaft_speed
    assert after < 0.9 * before
    assert library.vehicle(path).source != library.vehicle("remus100").source


@pytest.mark.parametrize("name", ["x.jpg", "x", "x.png.gif"])
def test_a_still_is_a_png(tmp_path, capsys, name) -> None:
    """Under no other name."""
    from auvsim.cli import products

    with pytest.raises(InputError, match=r"the picture is a PNG; give a name that ends in \.png"):
        products.still(None, tmp_path, path=tmp_path / name)  # pyright: ignore[reportArgumentType]
