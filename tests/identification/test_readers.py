"""Reading logs: the same record from any units, rates, signs and files; what is dropped is counted."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import netcdf_file
from tables import SHAFT, columns, every, synthetic, write

from auvsim.base.errors import InputError
from auvsim.data import log
from auvsim.identification import log_records, reckoning, signals
from auvsim.identification.readers import read
from auvsim.identification.records import MEASURED, Record
from auvsim.identification.signals import Signal, Signals
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run as run_trial

NORTH, EAST, HEADING, SURGE, YAW_RATE = (MEASURED.index(n) for n in ("north", "east", "heading", "surge", "yaw_rate"))


def only(path: Path, **options) -> tuple[Record, str]:
    """The one record of a file, and the notes."""
    readings = read([path], **options)
    assert len(readings.records) == 1, readings.notes
    return readings.records[0], " | ".join(readings.notes)


def assert_same(found: Record, wanted: Record) -> None:
    """The same grid and values; a grid point's input is the mean to the next one, so those of the ends are left out."""
    assert len(found.times) == len(wanted.times)
    np.testing.assert_allclose(found.times - found.times[0], wanted.times - wanted.times[0], atol=1e-9)
    turns = 2.0 * np.pi * np.round((found.measured[0, HEADING] - wanted.measured[0, HEADING]) / (2.0 * np.pi))
    shift = np.zeros(8)
    shift[HEADING] = turns
    np.testing.assert_allclose(found.measured - shift, wanted.measured, atol=1e-9, equal_nan=True)
    means = 0.5 * (wanted.inputs[:-1] + wanted.inputs[1:])
    np.testing.assert_allclose(found.inputs[:-1], means, atol=1e-9)


def test_units_of_headers_come_to_si(tmp_path: Path) -> None:
    """Degrees, revolutions a minute, centimetres a second; commas or semicolons; brackets or suffixes."""
    record = synthetic()
    table = columns(record)
    found, notes = only(write(tmp_path / "a.csv", table))
    assert_same(found, record)
    assert notes == ""
    m = record.measured
    renamed = {
        "t": record.times, "rudder_deg": table["rudder [deg]"], "rpm": table["n [rpm]"], "psi_rad": m[:, HEADING],
        "r (rad/s)": m[:, YAW_RATE], "u_m_s": m[:, SURGE], "v_mps": m[:, 4], "ground_surge_kn": m[:, 6] * 3600 / 1852,
        "ground_sway_km/h": m[:, 7] * 3.6, "north_km": m[:, NORTH] / 1000.0, "east": m[:, EAST],
    }  # fmt: skip
    found, notes = only(write(tmp_path / "b.csv", renamed, ";"))
    assert_same(found, record)
    assert "taken as SI: east in m" in notes


def test_netcdf_files_of_both_kinds(tmp_path: Path) -> None:
    """NetCDF-4 with groups and a clock for each rate, and the classic format with a fill value."""
    record = synthetic()
    m = record.measured
    with h5py.File(tmp_path / "new.nc", "w") as file:
        for group, step, values in (
            (
                "control",
                1,
                {"rudder": (np.degrees(record.inputs[:, 0]), "degree"), "n": (record.inputs[:, 1], "rad s-1")},
            ),
            ("imu", 1, {"heading": (np.degrees(m[:, 2]), "degrees"), "yaw_rate": (m[:, 5], "rad/s")}),
            ("dvl", 4, {"u": (m[:, 6], "m s-1"), "v": (m[:, 7], "m/s")}),
        ):
            clock = file.create_dataset(f"{group}/time", data=record.times[::step])
            clock.make_scale("time")
            clock.attrs["units"] = "seconds since 2024-01-01"
            for name, (data, unit) in values.items():
                variable = file.create_dataset(f"{group}/{name}", data=data[::step])
                variable.dims[0].attach_scale(clock)
                variable.attrs["units"] = unit
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "time: control/time\nrudder: control/rudder\nshaft_speed: control/n\nheading: imu/heading\n"
        "yaw_rate: imu/yaw_rate\nground_surge: dvl/u\nground_sway: {column: dvl/v}\n"
    )
    found, _ = only(tmp_path / "new.nc", columns=mapping)
    wanted = np.full_like(m, np.nan)
    wanted[:, [2, 5]] = m[:, [2, 5]]
    wanted[::4, 6:] = m[::4, 6:]
    assert_same(found, replace(record, measured=wanted))

    with netcdf_file(tmp_path / "old.nc", "w") as file:
        file.createDimension("time", len(record.times))
        for name, data, unit in (
            ("time", record.times, "s"), ("rudder", np.degrees(record.inputs[:, 0]), "deg"),
            ("n", record.inputs[:, 1], "rad/s"), ("heading", m[:, 2], "rad"), ("surge", m[:, 3], "m/s"),
        ):  # fmt: skip
            variable = file.createVariable(name, "d", ("time",))
            variable[:] = np.where(np.arange(len(data)) % 7, data, -999.0) if name == "surge" else data
            variable.units = unit
            if name == "surge":
                variable._FillValue = -999.0
    found, notes = only(tmp_path / "old.nc")
    surge = np.where(np.arange(len(m)) % 7, m[:, SURGE], np.nan)
    np.testing.assert_allclose(found.measured[:, SURGE], surge, equal_nan=True)
    assert f"{np.isnan(surge).sum() - 1} missing" in notes  # the first is before any sample, not between them


def test_several_rates_as_rows_of_nan_or_clocks_of_their_own(tmp_path: Path) -> None:
    """A log at 2.5 Hz and fixes every 5 s beside 10 Hz: padded, and as columns with stamps 0.03 s off the grid."""
    record = synthetic()
    table = columns(record)
    padded = {**table, **{name: every(table[name], 4) for name in ("dvl_u [cm/s]", "dvl_v [cm/s]")}}
    padded |= {name: every(table[name], 50, 7) for name in ("north [m]", "east [m]")}
    found, notes = only(write(tmp_path / "padded.csv", padded))
    assert notes == ""  # rows of a slower sensor are not missing
    there = np.isfinite(found.measured)
    assert there[:, 6].sum() == 150
    assert there[:, NORTH].sum() == 12
    assert_same(found, replace(record, measured=np.where(there, record.measured, np.nan)))

    late = record.times + 0.03
    own = {**table, "time_dvl [s]": late}
    for column, name in ((6, "dvl_u [cm/s]"), (7, "dvl_v [cm/s]")):
        own[name] = 100.0 * (1.5 + 0.2 * late * (1 if column == 6 else -1))  # a line: the local slope is exact
    found, _ = only(write(tmp_path / "own.csv", own))
    ramp = np.stack([1.5 + 0.2 * found.times, 1.5 - 0.2 * found.times], axis=-1)
    np.testing.assert_allclose(found.measured[1:-1, 6:], ramp[1:-1], atol=1e-9)


def test_inputs_are_means_of_what_drove(tmp_path: Path) -> None:
    """Area under the rudder is kept when the grid is coarser; a command is held, a measured angle linear."""
    t = np.arange(0.0, 30.0, 0.1)
    x = np.sin(t)
    linear = signals._means(Signal(times=t, values=x), np.arange(0.0, 29.0, 0.35), 0.35)
    area = 1.0 - np.cos(0.35 * (len(linear) - 1))
    assert np.sum(linear[:-1]) * 0.35 == pytest.approx(area, rel=0.1**2 / 12 * 1.01)  # chords of a sine lose h^2 / 12
    held = signals._means(
        Signal(times=np.array([0.0, 1.0, 2.0]), values=np.array([0.0, 1.0, 0.0]), held=True), t[:20], 0.1
    )
    np.testing.assert_allclose(held[:19], (t[:19] > 0.95).astype(float), atol=1e-9)


def test_gaps_split_and_manoeuvres_are_told_apart(tmp_path: Path) -> None:
    """A hole of 5 s in the rudder, a column of names, a clock that begins again; what is short is counted."""
    record = synthetic(duration=100.0)
    table = columns(record)
    holed = {
        **table,
        "rudder [deg]": np.where((record.times > 40.0) & (record.times < 45.0), np.nan, table["rudder [deg]"]),
    }
    readings = read([write(tmp_path / "holed.csv", holed)])
    assert [round(r.duration) for r in readings.records] == [40, 55]
    assert "49 missing" in " ".join(readings.notes)
    assert "split into 2 records" in " ".join(readings.notes)

    names = np.where(record.times < 30.0, "zigzag", np.where(record.times < 95.0, "circle", "stop"))
    readings = read([write(tmp_path / "named.csv", {**table, "manoeuvre": names.tolist()})])
    assert [(r.kind, round(r.duration)) for r in readings.records] == [("zigzag", 30), ("circle", 65)]
    assert "5 s in spans shorter than 10 s dropped" in " ".join(readings.notes)

    again = {**table, "time [s]": np.where(record.times < 50.0, record.times, record.times - 50.0)}
    assert [round(r.duration) for r in read([write(tmp_path / "again.csv", again)]).records] == [50, 50]


def test_repeated_stamps_and_words_are_dropped_and_counted(tmp_path: Path) -> None:
    """Rows logged twice, and cells such as ERR in a column of numbers."""
    record = synthetic()
    table = {
        name: np.repeat(values, np.where(np.arange(600) % 100 == 5, 2, 1)) for name, values in columns(record).items()
    }
    speeds = [repr(float(value)) for value in table["surge [m/s]"]]
    speeds[200] = "ERR"
    found, notes = only(
        write(tmp_path / "twice.csv", {**table, "surge [m/s]": speeds, "battery [V]": table["time [s]"]})
    )
    assert len(found.times) == 600
    assert "6 with repeated stamps dropped" in notes
    assert "1 cells of 'surge [m/s]' are no numbers" in notes
    assert "columns not used: battery [V]" in notes


def test_a_map_names_turns_and_weighs_columns(tmp_path: Path) -> None:
    """A rudder positive to port, a shaft that is not logged, a deviation given; the map goes before names."""
    record = synthetic()
    table = columns(record)
    theirs = {
        "time [s]": record.times, "d": -table["rudder [deg]"], "heading [deg]": table["heading [deg]"],
        "surge": table["surge [m/s]"] * 100.0,
    }  # fmt: skip
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "rudder: {column: d, unit: deg, sign: -1}\nshaft_speed: {constant: 1000, unit: rpm}\n"
        "surge: {column: surge, unit: cm/s, sd: 3}\n"
    )
    found, _ = only(write(tmp_path / "theirs.csv", theirs), columns=mapping)
    np.testing.assert_allclose(found.inputs[:-1, 0], 0.5 * (record.inputs[:-1, 0] + record.inputs[1:, 0]), atol=1e-9)
    np.testing.assert_allclose(found.inputs[:, 1], 1000.0 * np.pi / 30.0)
    np.testing.assert_allclose(found.measured[:, SURGE], record.measured[:, SURGE], atol=1e-9)
    assert found.deviations[SURGE] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rudder: {column: d, units: deg}", "rudder.units"),
        ("rudder: {column: d, constant: 3}", "either a column or a constant"),
        ("helm: {column: d}", "no quantity 'helm'; there are"),
        ("- rudder", "a column map is a mapping"),
        ("rudder: {column: e}", "no column 'e'; there are"),
        ("rudder: {column: d, unit: furlong}", "'furlong' is no unit of rudder; there are rad, deg"),
    ],
)
def test_a_wrong_map_is_refused(tmp_path: Path, text: str, said: str) -> None:
    """Each in one line that names the key."""
    mapping = tmp_path / "map.yaml"
    mapping.write_text(text + "\n")
    table = {"time": [0.0, 1.0], "d": [0.0, 1.0], "n": [1.0, 1.0], "heading": [0.0, 0.0]}
    with pytest.raises(InputError) as caught:
        read([write(tmp_path / "a.csv", table)], columns=mapping)
    assert said in str(caught.value)


def test_noise_is_estimated_from_the_signal() -> None:
    """Third differences of a smooth motion with white noise: within 10 % of it for 3000 samples (its sd is 3 %)."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 300.0, 0.1)
    for sd in (0.005, 0.05):
        signal = Signal(times=t, values=1.5 + 0.3 * np.sin(0.4 * t) + sd * rng.standard_normal(len(t)))
        assert signals.noise(signal, "surge") == pytest.approx(sd, rel=0.1)
    assert signals.noise(Signal(times=t, values=np.round(np.sin(0.01 * t))), "surge") == pytest.approx(0.002)


def test_latitude_longitude_and_known_current(tmp_path: Path) -> None:
    """A degree of latitude is 111.19 km on the mean sphere; of longitude that times the cosine."""
    record = synthetic()
    table = {name: values for name, values in columns(record).items() if name not in ("north [m]", "east [m]")}
    table["lat"] = 60.0 + np.arange(600) * 1e-5
    table["lon"] = 5.0 + np.arange(600) * 1e-5
    table["current_north"], table["current_east"] = np.full(600, 0.1), np.full(600, -0.2)
    found, _ = only(write(tmp_path / "gps.csv", table))
    places = found.measured[-1, [NORTH, EAST]] - found.measured[0, [NORTH, EAST]]
    np.testing.assert_allclose(places, 599e-5 * 111_194.9 * np.array([1.0, 0.5]), rtol=1e-4)
    assert found.current is not None
    np.testing.assert_allclose(found.current, [0.1, -0.2])


def test_strays_are_found_and_nothing_else() -> None:
    """Fixes every 5 s of a turning vehicle with 0.5 m of noise: outliers of 10 m and more are found, no other is.

    Six deviations are passed by chance once in 10^8 fixes; 20 runs have 1200.
    """
    for seed in range(20):
        record = synthetic(seed, 300.0, kind="zigzag")
        rng = np.random.default_rng(seed)
        rows = np.arange(20, 3000, 50)
        places = record.measured[rows, :2].copy()
        wrong = rng.random(len(rows)) < 0.05
        direction = np.exp(1j * rng.uniform(-np.pi, np.pi, len(rows))) * rng.uniform(10.0, 30.0, len(rows))
        places += np.where(wrong, direction, 0.0).view(float).reshape(-1, 2)
        t = record.times
        given = {
            "north": (t[rows], places[:, 0]),
            "east": (t[rows], places[:, 1]),
            "heading": (t, record.measured[:, 2]),
        }
        given |= {name: (t, record.measured[:, MEASURED.index(name)]) for name in ("ground_surge", "ground_sway")}
        assert np.array_equal(reckoning.outliers(given, 0.5), wrong), seed


def test_a_trial_log_is_read_as_the_vehicle_sensed_it(tmp_path: Path) -> None:
    """Against the truth of the same log: no error beyond the sensors', and nothing lost or flagged by truth is used."""
    plan = sampling.merge(sampling.manoeuvre_plan("zigzag"), {"manoeuvre": {"duration": 60.0}})
    found = run_trial(scenario.parse(sampling.draw(plan, 5)), seed=5)
    log.write(found, tmp_path / "zigzag.nc")
    truth = found.vehicle()
    record, _ = only(tmp_path / "zigzag.nc")
    assert record.kind == "zigzag"
    at = np.searchsorted(truth["truth"]["time"], record.times - 1e-6)
    t = {name: values[at] for name, values in truth["truth"].items()}
    measured, sds = record.measured, record.deviations
    # Sensors' constant errors at three deviations of their own: compass 1.5 deg, gyro 0.015 deg/s, scale and mounting.
    heading = np.angle(np.exp(1j * (measured[:, HEADING] - t["attitude"][:, 2])))
    assert abs(np.nanmean(heading)) < np.radians(1.5)
    assert np.nanstd(heading) == pytest.approx(sds[HEADING], rel=0.1)  # of 600 samples: 3 %
    rate = measured[:, YAW_RATE] - t["nu"][:, 5]
    assert abs(np.nanmean(rate)) < np.radians(0.015)
    assert np.nanstd(rate) == pytest.approx(sds[YAW_RATE], rel=0.1)
    over = measured[:, 6] - t["nu"][:, 0]
    assert abs(np.nanmean(over)) < 0.02
    assert np.nanstd(over) == pytest.approx(sds[6], rel=0.15)
    fixes = np.hypot(measured[:, NORTH] - t["position"][:, 0], measured[:, EAST] - t["position"][:, 1])
    assert (
        np.nanmax(fixes) < 6.0
    )  # 0.48 m an axis, and the dock's compass 0.9 deg over 380 m; outliers are 10 m and more
    # The rudder of the fins, and the shaft, between their samples.
    assert np.abs(record.inputs[:, 1] - SHAFT).max() < 0.2 * SHAFT


def test_docking_logs_leave_out_what_is_not_planar(tmp_path: Path) -> None:
    """Steep dives and the time in the dock are excluded; what is left is level and before the dock."""
    plan = scenario.parse(
        sampling.draw(sampling.merge(sampling.default_plan(), {"vehicle": {"start": {"depth": 10.0}}}), 1)
    )
    found = run_trial(plan, seed=1)
    log.write(found, tmp_path / "trial.nc")
    trial = found.vehicle()
    readings = read([tmp_path / "trial.nc"])
    assert readings.records
    assert "left out" in " ".join(readings.notes)
    docked = trial["mission"]["time"][trial["mission"]["phase"] == 4]
    for record in readings.records:
        at = np.searchsorted(trial["truth"]["time"], record.times - 1e-6)
        assert np.abs(np.degrees(trial["truth"]["attitude"][at, 1])).max() < 10.0
        assert len(docked) == 0 or record.times[-1] < docked[0]


def test_a_sequence_is_read_as_its_parts(tmp_path: Path) -> None:
    """Each with its kind, from where it began."""
    parts = [{"kind": "zigzag", "duration": 40.0}, {"kind": "circle", "duration": 30.0}]
    plan = sampling.merge(sampling.manoeuvre_plan("sequence"), {"manoeuvre": {"kind": "sequence", "parts": parts}})
    log.write(run_trial(scenario.parse(sampling.draw(plan, 2)), seed=2), tmp_path / "both.nc")
    found = read([tmp_path / "both.nc"]).records
    assert [(r.kind, round(r.duration)) for r in found] == [("zigzag", 40), ("circle", 30)]


def test_another_vehicles_log_is_refused(tmp_path: Path) -> None:
    """A log says whose it is; a file that is none is refused as such."""
    with pytest.raises(InputError, match="cannot be read"):
        read([tmp_path / "none.csv"])
    (tmp_path / "noise.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(InputError, match="not a whole NetCDF-4 file"):
        read([tmp_path / "noise.nc"])
    (tmp_path / "a.csv").write_text("1,2,3\n4,5,6\n")
    with pytest.raises(InputError, match="give each column a name"):
        read([tmp_path / "a.csv"])


def test_strays_need_a_heading() -> None:
    """Positions alone are not judged."""
    t = np.arange(20.0)
    assert not reckoning.outliers({"north": (t, t), "east": (t, 100.0 * (t == 9))}, 0.5).any()


def test_signals_without_positions_stay_as_they_are() -> None:
    """Nothing to judge, nothing dropped."""
    t = np.arange(0.0, 30.0, 0.1)
    one = Signals(
        name="x", signals={n: Signal(times=t, values=np.sin(t)) for n in ("rudder", "shaft_speed", "heading")}
    )
    found, notes = signals.records(one)
    assert (len(found), notes) == (1, [])
    assert log_records.MARGIN == signals.MARGIN
