"""Logs as people have them: odd stamps, fill values, units, decimals and axes are read rightly with a note, or refused.

Each is spoiled from a record whose true samples are known; what is read must be that record, or the line says why not.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tables import columns, synthetic, write

from auvsim.base.errors import InputError
from auvsim.identification import cleaning, clock_times
from auvsim.identification.columns import read_map
from auvsim.identification.readers import read
from auvsim.identification.records import MEASURED, Readings, Record

RECORD = synthetic(4, 120.0)
TABLE = columns(RECORD)
SURGE, HEADING, GROUND = (MEASURED.index(name) for name in ("surge", "heading", "ground_surge"))


def read_table(path: Path, **options) -> tuple[Record, str]:
    """The one record of a file, and the notes."""
    readings: Readings = read([path], **options)
    assert len(readings.records) == 1, readings.notes
    return readings.records[0], " | ".join(readings.notes)


def assert_measured(found: Record, tolerance: float = 1e-6, skip: int = 0) -> None:
    """What was measured is the record's, up to whole turns and a shift of the clock."""
    n = min(len(found.times), len(RECORD.times))
    assert n > 0.97 * len(RECORD.times)
    a, b = found.measured[skip : n - 1].copy(), RECORD.measured[skip : n - 1].copy()
    a[:, HEADING] += 2.0 * np.pi * np.round((b[0, HEADING] - a[0, HEADING]) / (2.0 * np.pi))
    np.testing.assert_allclose(a, b, atol=tolerance)


def text(path: Path, lines: list[str]) -> Path:
    """A file of lines."""
    path.write_text("\n".join(lines) + "\n")
    return path


def rows(form: Callable[[float], str] = repr, delimiter: str = ";") -> list[str]:
    """The rows of the table as text."""
    return [delimiter.join(form(float(v)) for v in row) for row in zip(*TABLE.values(), strict=True)]


def test_decimal_commas(tmp_path: Path) -> None:
    """With semicolons or tabs between them, and thousands apart by points."""
    for delimiter in ";\t":
        lines = [delimiter.join(TABLE), *rows(lambda v: repr(v).replace(".", ","), delimiter)]
        found, notes = read_table(text(tmp_path / "comma.csv", lines))
        assert_measured(found)
        assert "decimal commas" in notes
    assert cleaning_of("1.012,5") == 1012.5


def cleaning_of(cell: str) -> float:
    """What the reader makes of a number with a decimal comma."""
    from auvsim.identification.table_text import _column, _with_point

    return float(_column([_with_point(cell)], None).values[0])


def test_mixed_decimals_and_commas_for_both(tmp_path: Path) -> None:
    """A comma in one column and a point in another are refused; so are decimal commas between commas, by name."""
    mixed = [
        ";".join(repr(float(v)).replace(".", ",") if k else repr(float(v)) for k, v in enumerate(row))
        for row in zip(*TABLE.values(), strict=True)
    ]
    with pytest.raises(InputError, match=r"has a decimal comma .* a decimal point"):
        read([text(tmp_path / "mixed.csv", [";".join(TABLE), *mixed])])
    both = [",".join(TABLE), *rows(lambda v: f"{v:.3f}".replace(".", ","), ",")]
    with pytest.raises(InputError, match=r"decimal commas\? then separate the columns by semicolons"):
        read([text(tmp_path / "both.csv", both)])


def test_sparse_numbers_with_decimal_commas(tmp_path: Path) -> None:
    """A column with a number in few rows is a slow sensor, whichever its decimals."""
    slow = TABLE["north [m]"].copy()
    slow[np.arange(len(slow)) % 35 != 34] = np.nan
    table = {**TABLE, "north [m]": slow, "east [m]": np.where(np.isnan(slow), np.nan, TABLE["east [m]"])}
    cells = [["" if v != v else repr(float(v)).replace(".", ",") for v in column] for column in table.values()]
    found, _ = read_table(text(tmp_path / "sparse.csv", [";".join(table), *map(";".join, zip(*cells, strict=True))]))
    there = np.isfinite(found.measured[:, 0])
    assert there.sum() == np.isfinite(slow).sum()


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_epoch_stamps_without_a_unit(unit: str, scale: float, tmp_path: Path) -> None:
    """Their size tells the unit, with a note; a header that says seconds is refused."""
    stamps = np.round((1.7e9 + RECORD.times) * scale)
    table = {"time": stamps, **{k: v for k, v in TABLE.items() if k != "time [s]"}}
    found, notes = read_table(write(tmp_path / "epoch.csv", table))
    assert_measured(found, 1e-3)  # a float of seconds since 1970 has steps of 0.2 us; the slopes of 1 m/s and 0.1 rad/s
    assert f"counts since 1970 in {unit}" in notes
    wrong = {"time [s]": stamps, **{k: v for k, v in TABLE.items() if k != "time [s]"}}
    with pytest.raises(InputError, match="beyond the year 5000"):
        read([write(tmp_path / "wrong.csv", wrong)])


def test_milliseconds_since_the_start_without_a_unit(tmp_path: Path) -> None:
    """Rows a hundred seconds apart are refused at once; with their unit they are read."""
    others = {k: v for k, v in TABLE.items() if k != "time [s]"}
    with pytest.raises(InputError, match="rows lie 100 apart: seconds, or milliseconds"):
        read([write(tmp_path / "a.csv", {"time": RECORD.times * 1e3, **others})])
    found, _ = read_table(write(tmp_path / "b.csv", {"time [ms]": RECORD.times * 1e3, **others}))
    assert_measured(found)


@pytest.mark.parametrize("first", [0, 3])
def test_whole_second_stamps_at_ten_hertz(first: int, tmp_path: Path) -> None:
    """Ten rows of one stamp are spread evenly over the second, also where the first second is cut."""
    table = {name: values[first:] for name, values in TABLE.items()}
    table["time [s]"] = np.floor(table["time [s]"] + 1e-9)
    found, notes = read_table(write(tmp_path / "whole.csv", table))
    assert "stands for about 10 rows: spread evenly" in notes
    steps = np.diff(found.times)
    np.testing.assert_allclose(steps, 0.1, atol=1e-6)
    n = len(found.times) - 1
    np.testing.assert_allclose(found.measured[:n, SURGE], RECORD.measured[first : first + n, SURGE], atol=1e-9)


@pytest.mark.parametrize(
    ("form", "beginning"),
    [
        ("{h:02d}:{m:02d}:{s:09.6f}", 86400.0 - 60.0),
        ("27.11.2026 {h:02d}:{m:02d}:{s:09.6f}", 36000.0),
        ("27/11/2026 {h:02d}:{m:02d}:{s:09.6f}", 36000.0),
        ("2026-11-27T{h:02d}:{m:02d}:{s:09.6f}Z", 36000.0),
    ],
)
def test_clock_and_dates(form: str, beginning: float, tmp_path: Path) -> None:
    """A clock alone goes on over midnight; dates stand day first or in ISO's order."""
    said = []
    for t in RECORD.times + beginning:
        h, rest = divmod(t % 86400.0, 3600.0)
        m, s = divmod(rest, 60.0)
        said.append(form.format(h=int(h), m=int(m), s=s))
    table = {"time": said, **{k: v for k, v in TABLE.items() if k != "time [s]"}}
    found, _ = read_table(write(tmp_path / "clock.csv", table))
    assert_measured(found, 1e-3)
    assert found.times[-1] - found.times[0] == pytest.approx(RECORD.times[-1] - RECORD.times[0], abs=0.11)


def test_times_that_are_none(tmp_path: Path) -> None:
    """The line names the forms that are understood."""
    table = {"time": ["noon"] * len(RECORD.times), **{k: v for k, v in TABLE.items() if k != "time [s]"}}
    with pytest.raises(InputError, match=r"holds 'noon'; times are understood as seconds, 2026-.*day first"):
        read([write(tmp_path / "noon.csv", table)])
    found = clock_times.seconds(["23:59:59.5", "", "0:00:00,5"])
    assert found is not None
    np.testing.assert_allclose(found, [86399.5, np.nan, 86400.5])


def test_units_in_a_second_row(tmp_path: Path) -> None:
    """They are used; a name's own unit goes before."""
    m = RECORD.measured
    table = {
        "time": RECORD.times, "rudder": RECORD.inputs[:, 0], "n": RECORD.inputs[:, 1] * 30.0 / np.pi,
        "heading": m[:, 2], "r": m[:, 5], "u": m[:, 3] * 3600.0 / 1852.0, "v": m[:, 4] * 100.0,
        "dvl_u": m[:, 6], "dvl_v [cm/s]": 100.0 * m[:, 7], "north": m[:, 0] / 1000.0, "east": m[:, 1],
    }  # fmt: skip
    units = "s,rad,rpm,rad,rad/s,kn,cm/s,m/s,m/s,km,m"
    lines = [
        ",".join(table),
        units,
        *(",".join(repr(float(v)) for v in row) for row in zip(*table.values(), strict=True)),
    ]
    found, notes = read_table(text(tmp_path / "units.csv", lines))
    assert_measured(found, 1e-9)
    assert "second line is read as units" in notes
    assert "no unit given" not in notes


@pytest.mark.parametrize("finer", [1, 4])
def test_heading_resampled_over_north(finer: int, tmp_path: Path) -> None:
    """Samples that an interpolation put on the way through south are dropped, and no full turn is made of them."""
    heading = RECORD.measured[:, HEADING] - np.median(RECORD.measured[:, HEADING])  # north in its middle
    times, coarse = RECORD.times, np.degrees(heading) % 360.0
    assert np.sum(np.abs(np.diff(coarse)) > 180.0) >= 4
    # Resampled between the samples, as a logger on another clock does; or several to each.
    fine = times[:-1] + 0.04 if finer == 1 else np.arange(0.0, times[-1], 0.1 / finer)
    table = {name: np.interp(fine, times, TABLE[name]) for name in ("rudder [deg]", "n [rpm]", "surge [m/s]")}
    table = {"time [s]": fine, "heading [deg]": np.interp(fine, times, coarse), **table}
    found, notes = read_table(write(tmp_path / "north.csv", table))
    assert "between two sides of north" in notes
    there = np.isfinite(found.measured[:, HEADING])
    assert there.mean() > 0.9
    off = found.measured[there, HEADING] - np.interp(found.times[there] + fine[0], times, heading)
    off -= 2.0 * np.pi * np.round(off[0] / (2.0 * np.pi))
    assert np.abs(off).max() < np.radians(3.0)  # samples at the noise of 0.5 deg of the compass; a turn would be 360


@pytest.mark.parametrize("fill", [-9999.0, 999.9, 1e35, -32768.0])
def test_fill_values(fill: float, tmp_path: Path) -> None:
    """They are missing, with a note, in any column; also where most rows hold them."""
    for name, quantity in (("surge [m/s]", "surge"), ("heading [deg]", "heading"), ("dvl_u [cm/s]", "ground_surge")):
        values = TABLE[name].copy()
        values[50:90] = fill
        found, notes = read_table(write(tmp_path / "fill.csv", {**TABLE, name: values}))
        column = MEASURED.index(quantity)
        assert f"{name}: 40 of 1200 values that cannot be" in notes
        there = np.isfinite(found.measured[:, column])
        assert there.sum() == 1160
        off = found.measured[there, column] - RECORD.measured[: len(there), column][there]
        assert np.abs(off - np.round(off / (2 * np.pi)) * 2 * np.pi * (quantity == "heading")).max() < 1e-6
    slow = np.full(1200, fill)
    slow[::20] = TABLE["surge [m/s]"][::20]
    found, _ = read_table(write(tmp_path / "slow.csv", {**TABLE, "surge [m/s]": slow}))
    assert np.isfinite(found.measured[:, SURGE]).sum() == 60


def test_lone_spikes(tmp_path: Path) -> None:
    """A sample far from both neighbours is missing; a step that stays is not."""
    values = TABLE["surge [m/s]"].copy()
    values[[100, 500, 900]] += [9.0, -7.0, 30.0]
    gyro = TABLE["yaw_rate [deg/s]"].copy()
    gyro[[200]] += 100.0
    found, notes = read_table(
        write(tmp_path / "spikes.csv", {**TABLE, "surge [m/s]": values, "yaw_rate [deg/s]": gyro})
    )
    assert "surge [m/s]: 3 of 1200 values alone" in notes
    assert "yaw_rate [deg/s]: 1 of 1200 values alone" in notes
    assert np.flatnonzero(np.isnan(found.measured[:, SURGE])).tolist() == [100, 500, 900]
    assert not cleaning.spikes(np.where(np.arange(60) < 30, 0.0, 5.0), "speed").any()


def test_a_slow_sensor_written_in_every_row(tmp_path: Path) -> None:
    """A run of equal values is one sample, at its first row; values that are but rounded all count."""
    held = {name: values[np.arange(1200) // 10 * 10] for name, values in TABLE.items() if name.startswith("dvl")}
    found, notes = read_table(write(tmp_path / "held.csv", {**TABLE, **held}))
    assert "dvl_u [cm/s]: 1080 of 1200 values only repeated until the next sample" in notes
    there = np.flatnonzero(np.isfinite(found.measured[:, GROUND]))
    assert there.tolist() == list(range(0, 1200, 10))
    np.testing.assert_allclose(found.measured[there, GROUND], RECORD.measured[there, GROUND], atol=1e-9)
    rounded = np.round(TABLE["heading [deg]"])
    _, notes = read_table(write(tmp_path / "rounded.csv", {**TABLE, "heading [deg]": rounded}))
    assert "repeated" not in notes
    lost = TABLE["surge [m/s]"][np.arange(1200) // 10 * 10].copy()
    lost[300:310] = lost[295]  # one sample of the slow sensor did not come
    assert cleaning.held(lost).sum() == 1081


def test_degrees_and_minutes(tmp_path: Path) -> None:
    """4112.34 is 41 degrees and 12.34 minutes; what is neither is refused; the antimeridian is no jump."""
    reach = 6_371_000.0 * np.pi / 180.0
    north, east = RECORD.measured[:, 0], RECORD.measured[:, 1]
    lat, lon = 41.2 + north / reach, 8.5 + east / reach / np.cos(np.radians(41.2 + north[0] / reach))

    def minutes(degrees: np.ndarray) -> np.ndarray:
        whole = np.floor(degrees)
        return 100.0 * whole + 60.0 * (degrees - whole)

    others = {k: v for k, v in TABLE.items() if k not in ("north [m]", "east [m]")}
    found, notes = read_table(write(tmp_path / "a.csv", {**others, "lat": minutes(lat), "lon": minutes(lon)}))
    assert "read as degrees and minutes" in notes
    for column, true in ((0, north), (1, east)):
        np.testing.assert_allclose(found.measured[:, column] - found.measured[0, column], true - true[0], atol=1e-3)
    with pytest.raises(InputError, match=r"\(latitude\) reaches 4199.*largest is 90 deg"):
        read([write(tmp_path / "b.csv", {**others, "lat": np.full(1200, 4199.0), "lon": minutes(lon)})])
    around = (lon - np.median(lon)) % 360.0 - 180.0
    assert around.max() > 179.0
    assert around.min() < -179.0
    found, _ = read_table(write(tmp_path / "c.csv", {**others, "lat": lat, "lon": around}))
    np.testing.assert_allclose(found.measured[:, 1] - found.measured[0, 1], east - east[0], atol=1e-3)


def test_heading_from_east(tmp_path: Path) -> None:
    """Positions contradict it; the line gives the map that mends it, and with that map the record is as it was."""
    record = synthetic(9, 240.0, "turns")
    table = columns(record)
    mapped = {**table, "heading [deg]": (90.0 - table["heading [deg]"]) % 360.0}
    mapped["yaw_rate [deg/s]"] = -mapped["yaw_rate [deg/s]"]
    alone = {k: v for k, v in mapped.items() if not k.startswith(("surge", "sway", "dvl", "yaw"))}
    with pytest.raises(InputError, match=r"sign: -1, offset: 90.*in --columns mends it"):
        read([write(tmp_path / "alone.csv", alone)])
    with pytest.raises(InputError, match=r"sign: -1, offset: 90.*in --columns mends it"):
        read([write(tmp_path / "log.csv", mapped)])
    mending = tmp_path / "map.yaml"
    mending.write_text("heading: {column: heading, sign: -1, offset: 90}\nyaw_rate: {column: yaw_rate, sign: -1}\n")
    assert read_map(mending)["heading"].offset == 90.0
    readings = read([write(tmp_path / "log.csv", mapped)], columns=mending)
    straight = read([write(tmp_path / "straight.csv", table)])
    off = readings.records[0].measured[:, HEADING] - straight.records[0].measured[:, HEADING]
    np.testing.assert_allclose(np.angle(np.exp(1j * off)), 0.0, atol=1e-9)


def test_blanks_between_columns(tmp_path: Path) -> None:
    """Names with units in brackets count as one; the names may stand in a comment."""
    lines = ["  ".join(TABLE), *rows(delimiter="   ")]
    assert_measured(read_table(text(tmp_path / "blank.txt", lines))[0])
    plain = "time rudder_deg n_rpm heading_deg yaw_rate_deg/s surge sway dvl_u_cm/s dvl_v_cm/s north east"
    found, _ = read_table(text(tmp_path / "comment.txt", ["# made by a logger", f"# {plain}", *rows(delimiter=" ")]))
    assert_measured(found)


def test_all_that_is_missing_in_one_line(tmp_path: Path) -> None:
    """One line names every column that is needed and not there."""
    table = {"a": RECORD.times, "b": RECORD.times}
    with pytest.raises(InputError) as raised:
        read([write(tmp_path / "none.csv", table)])
    said = str(raised.value)
    for wanted in ("the time", "the rudder", "the heading or yaw rate", "`time [s]`", "`rudder [deg]`", "--columns"):
        assert wanted in said


def test_tables_of_no_one_vehicle_and_no_time(tmp_path: Path) -> None:
    """Rows of two vehicles, rows from last to first, one stamp for all, and a rudder once in 200 s: one line each.

    A column that names one vehicle throughout is none of these.
    """
    names = [*TABLE, "vehicle"]
    with pytest.raises(InputError, match="'vehicle' names 2 vehicles, auv_0, auv_1; give a file for each"):
        read([text(tmp_path / "two.csv", [";".join(names), *(f"{r};auv_{k % 2}" for k, r in enumerate(rows()))])])
    found, _ = read_table(text(tmp_path / "one.csv", [";".join(names), *(f"{r};auv_0" for r in rows())]))
    assert_measured(found)
    with pytest.raises(InputError, match="time never goes on"):
        read([text(tmp_path / "back.csv", [";".join(TABLE), *rows()[::-1]])])
    stamped = dict(TABLE)
    clock = next(name for name in TABLE if name.startswith("t"))
    for name, times, said in (
        ("same", np.full_like(TABLE[clock], 5.0), "time never goes on"),
        ("slow", 2000.0 * TABLE[clock], r"rudder comes every .* is the time in another unit"),
    ):
        stamped[clock] = times
        with pytest.raises(InputError, match=said):
            read([write(tmp_path / f"{name}.csv", stamped)])
