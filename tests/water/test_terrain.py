"""The sea floor: depths of a slope and of a grid, what rays and sensors meet, files that cannot be used."""

import h5py
import mujoco
import numpy as np
import pytest
from surroundings import Around

from auvsim.base.errors import InputError
from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.physics import scenes
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.truth import StructurePose, Truth
from auvsim.sensors.dvl import Dvl, DvlSettings
from auvsim.water.terrain import DepthGridSettings, SlopeSettings, build_terrain

NORTHS, EASTS = np.array([-60.0, -40.0, -10.0, 20.0, 90.0]), np.linspace(-30.0, 50.0, 9)
BOTTOM = "sea_floor_depth_below_mean_sea_level"


def hill(north, east):
    """A depth that is bilinear in north and east, and so exact between the points of any grid."""
    return 30.0 + 0.05 * north - 0.08 * east + 0.001 * north * east


def write(path, depths, *, axes=None, standard=BOTTOM, units="m"):
    """A NetCDF file of depths over y and x, unless it has other axes."""
    axes = {"y": NORTHS, "x": EASTS} if axes is None else axes
    with h5py.File(path, "w") as file:
        for name, values in axes.items():
            file[name] = values
            file[name].make_scale(name)
            file[name].attrs["units"] = {"lat": "degrees_north", "lon": "degrees_east"}.get(name, "m")
        file["bottom"] = depths
        file["bottom"].attrs.update({"units": units, "standard_name": standard})
        for k, axis in enumerate(axes):
            file["bottom"].dims[k].attach_scale(file[axis])
    return str(path)


def grid(path, **settings):
    return build_terrain(DepthGridSettings(file=str(path), **settings), 40.0)


def altitude(model, north, east):
    """What a ray meets that goes straight down from the surface: distance [m], and whether it is the floor."""
    data, geom = mujoco.MjData(model), np.zeros(1, dtype=np.int32)
    mujoco.mj_forward(model, data)
    ray = np.array([north, -east, 0.0]), np.array([0.0, 0.0, -1.0])
    return mujoco.mj_ray(model, data, *ray, None, 1, -1, geom), model.geom(int(geom[0])).name == "sea_floor"


def test_a_slope_gets_deeper_in_its_direction():
    floor = build_terrain(SlopeSettings(gradient=0.1, direction_deg=90.0), 25.0)
    assert floor.depth(70.0, 0.0) == pytest.approx(25.0, abs=1e-12)
    assert floor.depth(0.0, 30.0) == pytest.approx(28.0, abs=1e-12)


def test_a_grid_is_bilinear_and_held_beyond_its_edge(tmp_path):
    floor = grid(write(tmp_path / "a.nc", hill(NORTHS[:, None], EASTS)))
    for north, east in ((-60.0, -30.0), (13.0, 7.0), (89.0, 49.0), (90.0, 50.0)):
        assert floor.depth(north, east) == pytest.approx(hill(north, east), abs=1e-12)
    assert floor.depth(500.0, 7.0) == floor.depth(90.0, 7.0)
    assert floor.depth(13.0, -400.0) == floor.depth(13.0, -30.0)


def test_orders_signs_and_units_of_files(tmp_path):
    """Descending axes, east before north, heights, kilometres and degrees give the same floor."""
    depths = hill(NORTHS[:, None], EASTS)
    floors = [
        grid(write(tmp_path / "a.nc", depths[::-1], axes={"y": NORTHS[::-1], "x": EASTS})),
        grid(write(tmp_path / "b.nc", depths.T, axes={"x": EASTS, "y": NORTHS})),
        grid(write(tmp_path / "c.nc", -depths, standard="height_above_mean_sea_level")),
        grid(write(tmp_path / "d.nc", depths / 1000.0, units="km")),
        grid(write(tmp_path / "e.nc", -depths, standard="mine"), variable="bottom", positive="up"),
    ]
    for floor in floors:
        assert floor.depth(13.0, 7.0) == pytest.approx(hill(13.0, 7.0), abs=1e-9)
    degrees = {"lat": 52.0 + NORTHS / 111_267.0, "lon": 4.0 + EASTS / 68_678.0}  # lengths of a degree there on WGS84
    floor = grid(write(tmp_path / "f.nc", depths, axes=degrees), latitude=52.0, longitude=4.0)
    assert floor.depth(13.0, 7.0) == pytest.approx(hill(13.0, 7.0), abs=1e-3)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"standard": "depth_of_something"}, "no variable has the standard_name sea_floor_depth_below_mean_sea_level"),
        ({"units": "furlong"}, "'bottom' has the units 'furlong'"),
        ({"axes": {"y": NORTHS * [1, 1, 1, 1, -1], "x": EASTS}}, "coordinate north must increase or decrease"),
        ({"axes": {"lat": NORTHS / 1e5, "lon": EASTS / 1e5}}, "give the latitude and longitude of the datum"),
        ({"gap": True}, "1 of 45 points have no depth; fill them"),
    ],
)
def test_files_that_cannot_be_used(tmp_path, change, says):
    depths = hill(NORTHS[:, None], EASTS)
    if change.pop("gap", False):
        depths[2, 3] = np.nan
    with pytest.raises(InputError, match=says) as caught:
        grid(write(tmp_path / "a.nc", depths, **change))
    assert str(caught.value).startswith(str(tmp_path / "a.nc"))
    with pytest.raises(InputError, match="no such file"):
        grid(tmp_path / "none.nc")


def test_what_is_touched_is_where_the_depths_are(tmp_path):
    """Rays onto the compiled slope and grid; a cell's two triangles leave it by a quarter of its twist at most."""
    slope = WorldSettings(terrain=SlopeSettings(gradient=0.2, direction_deg=30.0))
    gridded = DepthGridSettings(file=write(tmp_path / "a.nc", hill(NORTHS[:, None], EASTS)))
    for settings, tolerance in ((slope, 1e-9), (WorldSettings(terrain=gridded), 0.25 * 0.001 * 10.0 * 20.0 + 1e-6)):
        model = scenes.scene({}, {}, settings, 100.0).model
        for north, east in ((0.0, 0.0), (30.0, -20.0), (-50.0, 40.0), (75.0, 13.0)):
            distance, is_floor = altitude(model, north, east)
            assert is_floor
            assert distance == pytest.approx(settings.floor.depth(north, east), abs=tolerance)


def test_the_doppler_log_measures_to_the_floor_below_it():
    """Bottom track ends where the slope is out of reach, though the depth at the datum is not."""
    floor = build_terrain(SlopeSettings(gradient=0.1, direction_deg=90.0), 25.0)
    around = Around(terrain=floor)
    dvl = Dvl(DvlSettings(dropout_probability=0.0, maximum_altitude=20.0), stream(1, 0, "dvl"))
    for east, tracks in ((40.0, True), (60.0, False)):  # 19 and 21 m above it
        attitude = np.array([0.0, 0.0, 1.0])
        truth = Truth(
            time=1.0, position=np.array([3.0, east, 10.0]), quaternion=euler_to_quaternion(*attitude),
            attitude=attitude, nu=np.zeros(6), current=np.zeros(3), actuators=np.zeros(5),
        )  # fmt: skip
        assert np.isfinite(dvl.measure(truth, around).value[:3]).all() == tracks


def test_a_dock_in_the_slope_is_refused():
    settings = WorldSettings(terrain=SlopeSettings(gradient=0.2, direction_deg=180.0))
    with pytest.raises(InputError, match=r"structures.dock.depth: a mouth .* the sea floor at 30 m"):
        scenes.scene({}, {"dock": ("dock", StructurePose(north=50.0, depth=29.8, heading=0.0))}, settings, 100.0)
