"""Grids of depths as GEBCO, EMODnet, GMT, MB-System and GDAL write them; and those that cannot be used, in one line."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from scipy.io import netcdf_file

from auvsim.base.errors import InputError
from auvsim.cli import main
from auvsim.water.depth_file import DepthGridSettings, read
from auvsim.water.terrain_grid import GriddedFloor

DATA = Path(__file__).parent / "data"
NORTHS, EASTS = np.linspace(-60.0, 90.0, 6), np.linspace(-30.0, 50.0, 9)  # [m]
DATUM: dict[str, Any] = {"latitude": 52.0, "longitude": 4.0}
LATITUDES, LONGITUDES = 52.0 + NORTHS / 111_267.0, 4.0 + EASTS / 68_678.0  # lengths of a degree there on WGS84


def hill(north: Any, east: Any) -> Any:
    """A depth [m] that is bilinear in north and east, and so exact between the points of any grid."""
    return 30.0 + 0.05 * north - 0.08 * east + 0.001 * north * east


DEPTHS = hill(NORTHS[:, None], EASTS)
Axes = dict[str, tuple[Any, dict[str, Any]]]
METRES: Axes = {"y": (NORTHS, {"units": "m"}), "x": (EASTS, {"units": "m"})}


def write(
    path: Path, values: Any, axes: Axes = METRES, name: str = "z", classic: bool = False, **attributes: Any
) -> Path:
    """A NetCDF file with one variable over axes, each with its attributes."""
    values = np.asarray(values)
    if classic:
        with netcdf_file(path, "w") as file:
            for key, (points, own) in axes.items():
                file.createDimension(key, len(points))
                made = file.createVariable(key, "d", (key,))
                made[:] = points
                for attribute, value in own.items():
                    setattr(made, attribute, value)
            made = file.createVariable(name, values.dtype, tuple(axes))
            made[:] = values
            for attribute, value in attributes.items():
                setattr(made, attribute, value)
        return path
    with h5py.File(path, "w") as file:
        for key, (points, own) in axes.items():
            file[key] = points
            file[key].make_scale(key)
            file[key].attrs.update(own)
        file[name] = values
        file[name].attrs.update(attributes)
        for k, key in enumerate(axes):
            file[name].dims[k].attach_scale(file[key])
    return path


def floor(path: Path, **settings: Any) -> GriddedFloor:
    """The floor of a file."""
    return read(DepthGridSettings(file=str(path), **settings))


def check(path: Path, within: float = 1e-9, **settings: Any) -> None:
    """The floor of a file is the hill."""
    found = floor(path, **settings)
    for north, east in ((13.0, 7.0), (-60.0, 50.0), (89.0, -29.0)):
        assert found.depth(north, east) == pytest.approx(hill(north, east), abs=within)


def test_gebco_and_emodnet(tmp_path: Path) -> None:
    """`elevation(lat, lon)`, whole metres of GEBCO, by standard name; EMODnet's with another 2D variable beside it."""
    axes: Axes = {
        "lat": (LATITUDES, {"standard_name": "latitude", "units": "degrees_north", "axis": "Y"}),
        "lon": (LONGITUDES, {"standard_name": "longitude", "units": "degrees_east", "axis": "X"}),
    }
    whole = -np.round(DEPTHS).astype(np.int16)
    up = {"standard_name": "height_above_mean_sea_level", "units": "m"}
    check(write(tmp_path / "g.nc", whole, axes, "elevation", **up), within=0.51, **DATUM)
    path = write(tmp_path / "e.nc", -DEPTHS, axes, "elevation", units="m", long_name="Mean depth")
    with h5py.File(path, "a") as file:
        file["value_count"] = np.ones(DEPTHS.shape, dtype=np.int32)
        file["value_count"].dims[0].attach_scale(file["lat"])
        file["value_count"].dims[1].attach_scale(file["lon"])
    check(path, within=1e-3, **DATUM)


@pytest.mark.parametrize("classic", [False, True])
def test_grids_of_gmt(tmp_path: Path, classic: bool) -> None:
    """`z` over lon and lat, without standard names or units of z; over x and y without any units."""
    axes: Axes = {
        "lat": (LATITUDES, {"long_name": "latitude", "units": "degrees_north"}),
        "lon": (LONGITUDES, {"long_name": "longitude", "units": "degrees_east"}),
    }
    attributes = {"long_name": "z", "_FillValue": np.float32(np.nan)}
    path = write(tmp_path / "a.grd", -DEPTHS.astype("f4"), axes, classic=classic, **attributes)
    check(path, within=1e-3, units="m", **DATUM)
    plain: Axes = {"y": (NORTHS, {"long_name": "y"}), "x": (EASTS, {"long_name": "x"})}
    path = write(tmp_path / "b.grd", -DEPTHS.astype("f4"), plain, classic=classic, **attributes)
    check(path, within=1e-5, units="m", coordinate_units="m")
    kilometres: Axes = {"y": (NORTHS / 1e3, {}), "x": (EASTS / 1e3, {})}
    check(write(tmp_path / "c.grd", DEPTHS, kilometres, classic=classic), units="m", coordinate_units="km")


def test_grids_of_mb_system(tmp_path: Path) -> None:
    """x and y that are longitudes and latitudes by their long names, topography in (m)."""
    axes: Axes = {"y": (LATITUDES, {"long_name": "Latitude"}), "x": (LONGITUDES, {"long_name": "Longitude"})}
    check(write(tmp_path / "a.grd", -DEPTHS, axes, long_name="Topography (m)"), within=1e-3, **DATUM)


@pytest.mark.parametrize("pixels", [False, True])
def test_grids_in_one_line_of_old_gmt(tmp_path: Path, pixels: bool) -> None:
    """Rows from north to south; the ranges are those of points, or of the edges of pixels."""
    beyond = 0.5 if pixels else 0.0
    with netcdf_file(tmp_path / "old.grd", "w") as file:
        file.createDimension("side", 2)
        file.createDimension("xysize", DEPTHS.size)
        for name, axis, step in (("x", EASTS, 10.0), ("y", NORTHS, 30.0)):
            made = file.createVariable(f"{name}_range", "d", ("side",))
            made[:], made.units = (axis[0] - beyond * step, axis[-1] + beyond * step), "m"
        made = file.createVariable("z_range", "d", ("side",))
        made[:], made.units = (-DEPTHS.max(), -DEPTHS.min()), "Topography (m)"
        made = file.createVariable("dimension", "i", ("side",))
        made[:] = DEPTHS.shape[::-1]
        made = file.createVariable("z", "f", ("xysize",))
        made[:], made.node_offset = -DEPTHS[::-1].ravel(), int(pixels)
    check(tmp_path / "old.grd", within=1e-5)


def slanted(north: Any, east: Any) -> Any:
    """Depths of the GeoTIFFs: rows from north (0 at 120 m) to south 10 m apart, columns to the east."""
    row, column = 11.5 - north / 10.0, east / 10.0 - 0.5
    return 30.0 + 0.5 * row - 0.8 * column + 0.05 * row * column


def test_geotiffs_of_gdal() -> None:
    """UTM, deflated Float32 with units; and degrees, LZW tiles of Int16 without. Pixels are areas: half of one off."""
    found = floor(DATA / "projected.tif", northing=5_700_000.0, easting=500_000.0)
    for north, east in ((5.0, 5.0), (33.0, 61.0), (115.0, 85.0)):
        assert found.depth(north, east) == pytest.approx(slanted(north, east), abs=1e-5)
    found = floor(DATA / "geographic.tif", units="m", latitude=52.01 - 5.5 / 1200.0, longitude=4.0 + 3.5 / 1200.0)
    assert found.depth(0.0, 0.0) == pytest.approx(slanted(65.0, 35.0), abs=0.51)  # row 5, column 3, whole metres
    assert found.corner.to_north == pytest.approx(111_267.0 / 1200.0, rel=1e-4)


def tiff(path: Path, values: Any, tags: dict[int, tuple[int, Any]]) -> Path:
    """A TIFF with tags by number, of a type and value each."""
    found = ImageFileDirectory_v2()
    for number, (kind, value) in tags.items():
        found.tagtype[number] = kind
        found[number] = value
    Image.fromarray(np.asarray(values, dtype=np.float32)).save(path, tiffinfo=found)
    return path


SHORT, TEXT, DOUBLE = 3, 2, 12
POINTS = {
    33550: (DOUBLE, (10.0, 30.0, 0.0)),
    33922: (DOUBLE, (0.0, 0.0, 0.0, -30.0, 90.0, 0.0)),
    34735: (SHORT, (1, 1, 0, 4, 1024, 0, 1, 1, 1025, 0, 1, 2, 3076, 0, 1, 9001, 4099, 0, 1, 9001)),
}


def test_pixels_that_are_points(tmp_path: Path) -> None:
    """The tie point is the first pixel's own place; the unit of heights is a key of the vertical system."""
    check(tiff(tmp_path / "a.tif", -DEPTHS[::-1], POINTS), within=1e-5)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({34735: (SHORT, (1, 1, 0, 1, 1025, 0, 1, 2))}, "without a projected or geographic reference system"),
        (
            {34735: (SHORT, (1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9001))},
            "'band 1' has no units; give them",
        ),
        ({33922: None}, "whose place is not given"),
        ({34264: (DOUBLE, (10.0, 1.0, 0, 0, 1.0, -10.0, *[0.0] * 10))}, "rows run neither north nor east"),
        ({42113: (TEXT, "-31.5")}, "1 of 54 points have no depth"),
        ({33922: (DOUBLE, 0.0)}, "a TIFF whose tags are broken"),
        ({34735: (SHORT, (1, 1, 0, 4, 1024, 0))}, "a TIFF whose tags are broken"),
    ],
)
def test_geotiffs_that_cannot_be_used(tmp_path: Path, change: dict, says: str) -> None:
    """No reference system, no units, no place, turned, a hole, tags of too few numbers."""
    tags = {number: tag for number, tag in {**POINTS, **change}.items() if tag is not None}
    values = -DEPTHS[::-1].copy()
    values[2, 3] = -31.5
    with pytest.raises(InputError, match=says):
        floor(tiff(tmp_path / "a.tif", values, tags))


def test_a_geotiff_of_doubles_is_refused() -> None:
    """It says how to make one that can be read."""
    with pytest.raises(InputError, match=r"doubles.tif: a TIFF that cannot be read .* `gdal_translate "):
        floor(DATA / "doubles.tif")


@pytest.mark.parametrize(
    ("unit", "length"), [("m", 1.0), ("km", 1e3), ("cm", 0.01), ("feet", 0.3048), ("fathoms", 1.8288)]
)
def test_units_that_are_stated(tmp_path: Path, unit: str, length: float) -> None:
    """They are converted."""
    check(write(tmp_path / "a.nc", DEPTHS / length, name="depth", units=unit))


@pytest.mark.parametrize(
    ("name", "values", "attributes", "settings"),
    [
        ("depth", DEPTHS, {}, {}),
        ("z", DEPTHS, {}, {}),
        ("z", -DEPTHS, {}, {}),
        ("elevation", -DEPTHS, {}, {}),
        ("z", -DEPTHS, {"positive": "up"}, {}),
        ("mine", -DEPTHS, {"positive": "up"}, {"variable": "mine"}),
        ("mine", -DEPTHS, {}, {"variable": "mine"}),
        ("elevation", DEPTHS, {"standard_name": "height_above_mean_sea_level"}, {"positive": "down"}),
    ],
)
def test_whether_values_are_depths_or_heights(
    tmp_path: Path, name: str, values: Any, attributes: dict, settings: dict
) -> None:
    """By settings, standard name, `positive`, name; where none says, the floor lies below the surface."""
    check(write(tmp_path / "a.nc", values, name=name, units="m", **attributes), **settings)


def holed(value: float, *places: tuple[int, int]) -> Any:
    """The hill with a value in some places."""
    values = DEPTHS.copy()
    for place in places:
        values[place] = value
    return values


UNEVEN = np.array([-60.0, -59.99, -10.0, 20.0, 50.0, 90.0])


@pytest.mark.parametrize(
    ("values", "axes", "attributes", "says"),
    [
        (holed(np.nan, (2, 3)), {}, {}, r"1 of 54 points have no depth; fill them \(the first at north 0 m, east 0 "),
        (holed(7.0, (2, 3)), {}, {"_FillValue": 7.0}, "1 of 54 points have no depth"),
        (holed(-9999.0, (2, 3), (2, 4), (3, 3), (3, 4)), {}, {}, "4 points are -9999, as files have it"),
        (DEPTHS, {}, {"units": "furlong"}, "'z' has the units 'furlong'; known are m"),
        (DEPTHS, {}, {"units": ""}, "'z' has no units; give them as `units`: m, km, cm, ft or fathom"),
        (DEPTHS / 1e3, {}, {}, "the deepest point is 0.035 m deep; are the depths in km"),
        (DEPTHS * 1e3, {}, {}, "a depth of 35000 m is more than that of any sea"),
        (DEPTHS * 100.0, {}, {}, "half of the floor is steeper than"),
        (DEPTHS - 33.0, {}, {}, "does not say whether that is down or up; give `positive: down`"),
        (-DEPTHS, {}, {"positive": "down"}, "all depths are 0 or less, down to -35 m, above the surface; say `pos"),
        (DEPTHS, {}, {"standard_name": "height_above_mean_sea_level"}, "all depths are 0 or less"),
        (DEPTHS, {"x": (EASTS, {})}, {}, "coordinate 'x' has no units; give them as `coordinate_units`"),
        (DEPTHS, {"x": (LONGITUDES, {"units": "m"})}, {}, "coordinate 'x' spans 0.00116 m by its units 'm'; is it in"),
        (DEPTHS, {"x": (EASTS / 1e3, {"units": "m"})}, {}, "'x' spans 0.08 m by its units 'm'"),
        (DEPTHS, {"y": (NORTHS / 1e3, {"units": "m"}), "x": (EASTS / 1e3, {"units": "m"})}, {}, "spans 0.15 m"),
        (DEPTHS, {"y": (500.0 + NORTHS, {"units": "degrees_north"})}, {}, "goes to 590 degrees; is it in metres"),
        (DEPTHS, {"y": (np.array([0, 1, 2, 2, 3, 4.0]), {"units": "m"})}, {}, "coordinate north must increase or decr"),
        (DEPTHS, {"y": (np.array([0, 1, 2, 9, 3, 4.0]), {"units": "m"})}, {}, "coordinate north must increase or decr"),
        (DEPTHS, {"y": (UNEVEN, {"units": "m"})}, {}, "steps of 0.01 to 50 m, which makes a regular grid of 15001 p"),
        (DEPTHS, {"y": (NORTHS, {"units": "m", "standard_name": "projection_x_coordinate"})}, {}, "is over east, east"),
    ],
)  # fmt: skip
def test_grids_that_cannot_be_used(tmp_path: Path, values: Any, axes: Axes, attributes: dict, says: str) -> None:
    """Holes, units, signs, coordinates: one line that begins with the file."""
    path = write(tmp_path / "a.nc", values, {**METRES, **axes}, **{"units": "m", **attributes})
    with pytest.raises(InputError, match=says) as caught:
        floor(path, **DATUM)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_transposed_values_are_found_by_their_coordinates(tmp_path: Path) -> None:
    """Longitude before latitude is taken as it is; values that do not fit their coordinates are not."""
    check(write(tmp_path / "a.nc", DEPTHS.T, {"x": METRES["x"], "y": METRES["y"]}, units="m"))
    with pytest.raises(InputError, match=r"coordinate 'y' is not one value for each of 9 points of 'z'"):
        floor(write(tmp_path / "b.nc", DEPTHS.T, units="m"))


def test_steps_that_grow_are_made_even(tmp_path: Path) -> None:
    """By half a percent from one to the next, a metre off in the middle; coordinates rounded to decimetres stay."""
    n, e = np.linspace(-60.0, 90.0, 101), EASTS
    grown = n + 1.0 - ((n - 15.0) / 75.0) ** 2
    for axis, kept in ((grown, False), (np.round(n, 1), True)):
        path = write(tmp_path / "a.nc", hill(axis[:, None], e), {**METRES, "y": (axis, {"units": "m"})}, units="m")
        check(path, within=0.01 if kept else 1e-9)
        assert (floor(path).depths.shape[0] == 101) == kept


def test_settings_that_contradict_the_file(tmp_path: Path) -> None:
    """Units of both; two variables that are depths; a variable that is not there."""
    path = write(tmp_path / "a.nc", DEPTHS, units="m")
    with pytest.raises(InputError, match="'z' has the units 'm'; `units: ft` contradicts them"):
        floor(path, units="ft")
    with pytest.raises(InputError, match="no variable 'depht'; there are x, y, z"):
        floor(path, variable="depht")
    with h5py.File(path, "a") as file:
        for name in ("one", "two"):
            file[name] = DEPTHS
            file[name].attrs.update({"units": "m", "standard_name": "sea_floor_depth_below_geoid"})
            for k, key in enumerate(("y", "x")):
                file[name].dims[k].attach_scale(file[key])
    with pytest.raises(InputError, match="one and two are depths or heights all; name one of them as `variable`"):
        floor(path)


@pytest.mark.parametrize(
    ("values", "north", "says"),
    [
        (holed(np.nan, (2, 3)), 0.0, "floor.nc: 1 of 54 points have no depth"),
        (DEPTHS, 5.7e6, "the grid from north 5699940 to 5700090 m, east -30 to 50 m holds no vehicle"),
    ],
)
def test_a_run_refuses_in_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    values: Any,
    north: float,
    says: str,
) -> None:
    """With exit code 2: a hole, and a projected grid whose datum is not given."""
    monkeypatch.chdir(tmp_path)
    write(Path("floor.nc"), values, {**METRES, "y": (NORTHS + north, {"units": "m"})}, units="m")
    Path("mine.yaml").write_text(
        "duration: 1\nworld: {terrain: {kind: grid, file: floor.nc}}\n"
        "vehicle: {start: {north: 0, east: 0, depth: 10}}\n"
        "mission: {kind: track, depth: 10, pattern: {kind: waypoints, points: [[0, 0], [40, 0]]}}\n"
    )
    assert main(["run", "mine.yaml"]) == 2
    error = capsys.readouterr().err.strip()
    assert says in error
    assert len(error.splitlines()) == 1
