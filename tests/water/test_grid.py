"""Gridded currents: interpolation, the files they come from, and every way in which a file is refused."""

import math

import h5py
import mujoco
import numpy as np
import pytest
from current_fields import build, check_derivatives
from scipy.io import netcdf_file

from auvsim.base.errors import InputError
from auvsim.base.frames import flip, flip_matrix
from auvsim.water.field import ZERO, Water
from auvsim.water.grid import Grid

TIMES, DEPTHS = np.array([0.0, 60.0, 180.0, 240.0]), np.array([0.0, 5.0, 12.0, 30.0])
NORTHS, EASTS = np.linspace(-40.0, 60.0, 6), np.array([-30.0, -10.0, 15.0, 30.0, 80.0])


def smooth(time, depth, north, east):
    """A flow that parabolas in each axis follow exactly."""
    u = 0.3 + 0.001 * time - 2e-6 * time**2 + 0.01 * depth + 1e-4 * north * east - 2e-5 * north**2
    v = -0.2 + 5e-4 * time * depth / 10 + 1e-3 * east - 3e-5 * east**2 * north / 50
    return np.stack(np.broadcast_arrays(u, v, 1e-3 * depth - 1e-5 * north * time / 50), axis=-1)


def sampled(axes=(TIMES, DEPTHS, NORTHS, EASTS), flow=smooth):
    return flow(*np.meshgrid(*axes, indexing="ij"))


def test_it_gives_the_points_and_follows_parabolas_between_them():
    grid = Grid((TIMES, DEPTHS, NORTHS, EASTS), sampled())
    random = np.random.default_rng(3)
    for time, depth, north, east in random.uniform([0, 0, -40, -30], [240, 30, 60, 80], (40, 4)).tolist():
        water = grid.evaluate(time, np.array([north, east, depth]))
        assert water.velocity == pytest.approx(smooth(time, depth, north, east), abs=1e-12)
        assert water.gradient[0, 1] == pytest.approx(1e-4 * north, abs=1e-12)
        assert water.gradient[1, 2] == pytest.approx(5e-5 * time, abs=1e-12)
        assert water.derivative[0] == pytest.approx(0.001 - 4e-6 * time, abs=1e-12)
    corner = grid.evaluate(240.0, np.array([60.0, 80.0, 30.0]))
    assert corner.velocity == pytest.approx(smooth(240.0, 30.0, 60.0, 80.0), abs=1e-12)


def test_derivative_and_gradient_are_exact_for_any_values():
    noise = np.random.default_rng(0).normal(size=(4, 4, 6, 5, 3))
    check_derivatives(Grid((TIMES, DEPTHS, NORTHS, EASTS), noise), [1, -39, -29, 0.5], [239, 59, 79, 29], within=1e-5)


def test_gradient_is_continuous_across_the_points():
    grid = Grid((TIMES, DEPTHS, NORTHS, EASTS), np.random.default_rng(0).normal(size=(4, 4, 6, 5, 3)))
    place = np.array([-20.0, 15.0, 12.0])
    here = grid.evaluate(60.0, place)
    for shift in np.vstack([np.eye(3), -np.eye(3)]) * 1e-9:
        there = grid.evaluate(60.0, place + shift)
        assert there.gradient == pytest.approx(here.gradient, abs=1e-8)
    before = grid.evaluate(60.0 - 1e-9, place)
    assert before.derivative == pytest.approx(here.derivative, abs=1e-8)


def test_outside_is_refused_or_held():
    axes, values = (TIMES, DEPTHS, NORTHS, EASTS), sampled()
    place = np.array([75.0, 10.0, 8.0])
    with pytest.raises(InputError, match="has north -40 to 60 m, not 75; or set outside: hold"):
        Grid(axes, values).evaluate(5.0, place)
    with pytest.raises(InputError, match="has time 0 to 240 s, not 241"):
        Grid(axes, values).evaluate(241.0, np.array([0.0, 0.0, 8.0]))
    held = Grid(axes, values, "hold").evaluate(5.0, place)
    edge = Grid(axes, values).evaluate(5.0, np.array([60.0, 10.0, 8.0]))
    assert held.velocity == pytest.approx(edge.velocity, abs=1e-15)
    assert not held.gradient[:, 0].any()
    assert held.gradient[:, 1:] == pytest.approx(edge.gradient[:, 1:], abs=1e-15)


def test_start_shifts_the_time():
    axes, values, place = (TIMES, DEPTHS, NORTHS, EASTS), sampled(), np.array([1.0, 2.0, 3.0])
    late = Grid(axes, values, start=100.0).evaluate(7.0, place)
    assert late.velocity == pytest.approx(Grid(axes, values).evaluate(107.0, place).velocity, abs=1e-15)


class Eddy:
    """A round eddy whose water turns as fast as its Gaussian stream function makes it; steady, any depth."""

    steady_uniform = False

    def __init__(self, speed, size, centre):
        self.strength, self.size, self.centre = speed * size * math.exp(0.5), size, centre

    def evaluate(self, time, position):
        x, y = (np.asarray(position)[:2] - self.centre) / self.size
        psi = self.strength * math.exp(-0.5 * (x * x + y * y))
        a, b = psi / self.size, psi / self.size**2
        gradient = b * np.array([[x * y, y * y - 1, 0.0], [1 - x * x, -x * y, 0.0], [0.0, 0.0, 0.0]])
        return Water(velocity=np.array([-a * y, a * x, 0.0]), derivative=ZERO, gradient=gradient)


def track(field, vehicle, seconds):
    """Positions of the remus100 under way with a little rudder, its water renewed ten times a second."""
    model, data = vehicle
    mujoco.mj_resetData(model, data)
    data.qpos[2] = -15.0
    data.qvel[0] = 1.5
    data.ctrl[:2], data.ctrl[4] = 0.01, 120.0
    positions = []
    for _ in range(round(10 * seconds)):
        water = field.evaluate(data.time, flip(data.qpos[:3]))
        data.userdata[:4] = data.time, *data.qpos[:3]
        data.userdata[4:10] = *flip(water.velocity), *flip(water.derivative)
        data.userdata[10:19] = flip_matrix(water.gradient).ravel()
        mujoco.mj_step(model, data, 10)
        positions.append(data.qpos[:3].copy())
    return np.array(positions)


def test_an_eddy_from_a_file_gives_the_track_of_the_eddy(tmp_path):
    """300 s in 0.4 m/s: the interpolation's error falls with the third power of the 5 m spacing."""
    from auvsim.physics import hydrodynamics
    from auvsim.vehicles import library

    root = library.vehicle("remus100").root
    root.find("body", "hull").add("freejoint")
    root.option.timestep = 0.01
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    hydrodynamics.equip(model)
    vehicle = model, mujoco.MjData(model)
    eddy = Eddy(0.4, 120.0, np.array([60.0, 90.0]))
    norths = easts = np.arange(-250.0, 551.0, 5.0)
    values = np.array([[eddy.evaluate(0.0, np.array([n, e, 0.0])).velocity[:2] for e in easts] for n in norths])
    path = tmp_path / "eddy.nc"
    write4(path, {"y": norths, "x": easts}, values[..., 0], values[..., 1])
    truth = track(eddy, vehicle, 300)
    found = track(build({"kind": "grid", "file": str(path)}), vehicle, 300)
    assert np.ptp(truth[:, 1]) > 100.0
    assert np.abs(found - truth).max() < 1e-3


COORDINATES = {
    "time": {"units": "seconds since 2026-05-01 00:00:00", "standard_name": "time"},
    "depth": {"units": "m", "positive": "down", "standard_name": "depth"},
    "y": {"units": "m", "standard_name": "projection_y_coordinate"},
    "x": {"units": "m", "standard_name": "projection_x_coordinate"},
    "lat": {"units": "degrees_north"},
    "lon": {"units": "degrees_east"},
}


def write4(path, axes, north, east, *, coordinates=None, units="m s-1", fill=None):
    """A NetCDF-4 file of two components on the axes in their order."""
    with h5py.File(path, "w") as file:
        for name, values in axes.items():
            file[name] = values
            file[name].make_scale(name)
            file[name].attrs.update((COORDINATES | (coordinates or {}))[name])
        for name, values in (("northward", north), ("eastward", east)):
            file[f"v_{name}"] = values
            attributes = {"units": units, "standard_name": f"{name}_sea_water_velocity"}
            file[f"v_{name}"].attrs.update(attributes | ({} if fill is None else {"_FillValue": fill}))
            for k, axis in enumerate(axes):
                file[f"v_{name}"].dims[k].attach_scale(file[axis])


def test_a_classic_file_packed_turned_upward_and_in_other_units(tmp_path):
    """Shorts of 0.1 mm/s in cm/s; axes in another order; heights and falling norths; hours; an upward component."""
    path = tmp_path / "currents.nc"
    values = sampled()
    with netcdf_file(path, "w") as file:
        for name, points, attributes in (
            ("x", EASTS / 1000.0, {"units": "km", "axis": "X"}),
            ("height", -DEPTHS, {"units": "m", "positive": "up", "axis": "Z"}),
            ("ocean_time", TIMES / 3600.0 + 7.0, {"units": "hours since 1970-01-01"}),
            ("northing", NORTHS[::-1], {"units": "m"}),
        ):
            file.createDimension(name, points.size)
            variable = file.createVariable(name, "d", (name,))
            variable[:] = points
            for key, value in attributes.items():
                setattr(variable, key, value)
        order = ("x", "height", "ocean_time", "northing")
        for name, standard, part in (
            ("a", "eastward_sea_water_velocity", values[..., 1]),
            ("b", "northward_sea_water_velocity", values[..., 0]),
            ("w", "upward_sea_water_velocity", -values[..., 2]),
        ):
            variable = file.createVariable(name, "h", order)
            variable.units, variable.standard_name, variable.scale_factor, variable.add_offset = (
                "cm/s",
                standard,
                0.01,
                5.0,
            )
            variable[:] = np.round((100.0 * part.transpose(3, 1, 0, 2)[..., ::-1] - 5.0) / 0.01).astype(np.int16)
    assert "240 s of currents from the start on, 300 s are needed; or set outside: hold" in refusal(
        path, duration=300.0
    )
    assert "140 s of currents from the start on, 200 s are needed" in refusal(path, start=100.0)
    grid = build({"kind": "grid", "file": str(path)})
    for time, depth, north, east in ((0.0, 0.0, -40.0, 80.0), (100.0, 7.0, 11.0, -3.0)):
        water = grid.evaluate(time, np.array([north, east, depth]))
        assert water.velocity == pytest.approx(smooth(time, depth, north, east), abs=2e-4)  # of the packing


def test_geographic_coordinates_are_metres_of_the_datum(tmp_path):
    """At 60 degrees north a degree of latitude is 111 412 m and one of longitude 55 800 m (WGS84 tables)."""
    path = tmp_path / "geographic.nc"
    latitudes, longitudes = np.array([59.99, 60.0, 60.02]), np.array([4.97, 5.0, 5.05, 5.06])
    east = np.broadcast_to(longitudes - 5.0, (3, 4)) * 10.0
    north = np.broadcast_to((latitudes - 60.0)[:, None], (3, 4)) * 10.0
    write4(path, {"lat": latitudes, "lon": longitudes}, north, east)
    data = {"kind": "grid", "file": str(path)}
    with pytest.raises(InputError, match="give the latitude and longitude of the datum"):
        build(data)
    grid = build({**data, "latitude": 60.0, "longitude": 365.0 - 360.0})
    assert grid.evaluate(0.0, np.array([1114.12, 0.0, 9.0])).velocity == pytest.approx([0.1, 0.0, 0.0], abs=1e-5)
    assert grid.evaluate(0.0, np.array([0.0, 558.0, 2.0])).velocity == pytest.approx([0.0, 0.1, 0.0], abs=1e-5)


def refusal(path, duration=200.0, **settings):
    with pytest.raises(InputError) as caught:
        build({"kind": "grid", "file": str(path), **settings}, duration=duration)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("missing", [np.nan, -999.0])
def test_gaps_are_refused_in_one_line(tmp_path, missing):
    path = tmp_path / "gaps.nc"
    north = np.zeros((6, 5))
    north[2, 3] = north[4, 1] = missing
    write4(path, {"y": NORTHS, "x": EASTS}, north, np.zeros((6, 5)), fill=-999.0)
    expected = "2 of 30 points have no current, the first at time 0, depth 0, north 0, east 30 [s, m]; fill them"
    assert expected in refusal(path)


def test_what_a_file_lacks_is_named(tmp_path):
    path = tmp_path / "bad.nc"
    assert "no such file" in refusal(path)
    path.write_bytes(b"\x89HDF nothing")
    assert "not a whole NetCDF file" in refusal(path)
    for text in (b"CDF\x01nothing", b"CDF\x01\0\0", b"CDF\x01" + bytes(4) + b"\0\0\0\x0a\0\0\0\x01"):
        path.write_bytes(text)
        assert "not a whole NetCDF file" in refusal(path)
    zeros = np.zeros((6, 5))
    write4(path, {"y": NORTHS, "x": EASTS}, zeros, zeros, units="knot")
    assert "'v_northward' has the units 'knot'; known are m/s" in refusal(path)
    write4(path, {"y": NORTHS, "x": EASTS}, zeros, zeros, coordinates={"x": {"units": "ft", "axis": "X"}})
    assert "'x' has the units 'ft'; known are m, " in refusal(path)
    write4(path, {"y": NORTHS, "x": EASTS}, zeros, zeros, coordinates={"x": {"units": "1", "long_name": "column"}})
    assert "'x' has the units '1'" in refusal(path)
    write4(path, {"y": NORTHS, "x": EASTS[[0, 2, 1, 3, 4]]}, zeros, zeros)
    assert "coordinate east does not increase or decrease all along" in refusal(path)
    write4(path, {"y": NORTHS, "x": EASTS}, zeros, zeros)
    assert "no variable 'u'; there are v_eastward, v_northward, x, y" in refusal(path, northward="u")
    assert build({"kind": "grid", "file": str(path)}).evaluate(1e6, np.zeros(3)).velocity.tolist() == [0.0, 0.0, 0.0]
    write4(path, {"time": TIMES, "y": NORTHS}, np.zeros((4, 6)), np.zeros((4, 6)))
    assert "the velocities have no coordinate east (or longitude)" in refusal(path)
