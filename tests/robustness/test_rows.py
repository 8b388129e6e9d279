"""Rows of what was once taken silently, ended in a traceback, or was said in words that mislead: one test a kind."""

import contextlib
import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.campaign import plan
from auvsim.cli import main
from auvsim.data import log
from auvsim.simulation import scenario
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import run
from auvsim.water.terrain import DepthGridSettings, build_terrain
from robustness.models import spoiled

TWO = """
duration: 2
structures: {dock: {}}
vehicles:
  ahead: {start: {range: 200.0}}
  astern: {start: {range: 100.0}}
"""
POINTS = "{kind: waypoints, points: [[0, 0], [50, 0]]}"


def refused(capsys, *arguments: str) -> str:
    """The one line with which the command line refuses arguments."""
    assert main([*arguments]) == 2
    *before, line = capsys.readouterr().err.splitlines()
    assert all(one.startswith("compiling ") for one in before)
    return line.removeprefix("auvsim: ")


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch) -> None:
    """A folder of its own, without pictures."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("auvsim.cli.products.plots", lambda *_: None)
    Path("two.yaml").write_text(TWO)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("run two.yaml --vehicles.ahaed.start.depth 9", "vehicles.ahaed: no vehicle 'ahaed'; there are ahead, astern"),
        ("run two.yaml --vehicles {Ahead: {}}", "vehicles.Ahead: no vehicle 'Ahead'; there are ahead, astern"),
        ("scenario two.yaml --structures.dok.depth 9", "structures.dok: no structure 'dok'; there are dock"),
        ("dock --vehicles.remus100.start.depth 9", "vehicles: the scenario is that of a lone vehicle"),
        ("dock --structures.dock.depth 9", "structures: the scenario is that of a lone vehicle"),
    ],
)
def test_a_mistyped_name_is_no_new_vehicle(capsys, arguments: str, says: str) -> None:
    """Nor a new structure."""
    assert refused(capsys, *arguments.split(maxsplit=3)).startswith(f"command line: {says}")


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("grid", {"vehicles.asturn.start.depth": [10.0, 12.0]}),
        ("variants", {"deep": {"vehicles": {"asturn": {"start": {"depth": 12.0}}}}}),
    ],
)
def test_nor_in_a_campaign(key: str, wrong: dict) -> None:
    """Neither in its grid nor in a variant; a name that there is, is taken by both."""
    base = {
        "structures": {"dock": {}},
        "vehicles": {name: {"start": {"range": 60.0 * k + 60.0}} for k, name in enumerate(("ahead", "astern"))},
    }
    with pytest.raises(InputError, match=r"vehicles\.asturn: no vehicle 'asturn'; there are ahead, astern"):
        plan.parse({"trials": 2, "base": base, key: wrong})
    right = json.loads(json.dumps(wrong).replace("asturn", "astern"))
    assert plan.parse({"trials": 2, "base": base, key: right}).fleet


def test_nor_in_a_script() -> None:
    """`load_scenario` adds none either."""
    with pytest.raises(InputError, match="no vehicle 'asturn'"):
        load_scenario("two.yaml", vehicles={"asturn": {"start": {"depth": 12.0}}})


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("--vehicle.ballast.cg_shift [0,0,99]", "vehicle.ballast.cg_shift: [0.0, 0.0, 99.0] m is out of the hull"),
        ("--vehicle.ballast.cb_shift [0,-0.2,0]", "vehicle.ballast.cb_shift: [0.0, -0.2, 0.0] m is out of the hull"),
        ("--vehicle.ballast.cg_shift [0.9,0,0]", "vehicle.ballast.cg_shift: [0.9, 0.0, 0.0] m is out of the hull"),
        ("--vehicle.ballast.net_buoyancy 31", "vehicle.ballast.net_buoyancy: 31 N is more than 10% of the weight"),
        ("--vehicle.start.speed 5", "vehicle.start.speed: 5 m/s is more than 'remus100' can hold, 2.5"),
        ("--rates.physics 20 --world.integrator RK4", "rates.physics: 20 Hz is too slow"),
        ("--dock.depth 39.5", "dock.depth: a mouth of radius 0.75 m"),
        ("--estimator.model nowhere", "estimator.model: no planar model 'nowhere'"),
        ("--world.terrain {kind: grid, file: .}", "world.terrain: .: it is a folder, not a file"),
        ("--current {kind: grid, file: .}", "current: .: it is a folder, not a file"),
    ],
)
def test_what_is_found_late_says_where_it_was_given(capsys, arguments: str, says: str) -> None:
    """By option, and by line of a file."""
    key, value = arguments.split(" ", 1)
    assert refused(capsys, "dock", key, *(value.split(" ") if key == "--rates.physics" else [value])).startswith(
        f"command line: {says}"
    )
    if key == "--rates.physics":
        return
    *above, last = key.removeprefix("--").split(".")
    lines = [f"{'  ' * depth}{name}:" for depth, name in enumerate(above)]
    Path("mine.yaml").write_text("\n".join([*lines, f"{'  ' * len(above)}{last}: {value}\n"]))
    assert refused(capsys, "dock", "mine.yaml").startswith(f"mine.yaml:{len(above) + 1}: {says}")
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("terrain", "says"),
    [
        ("{kind: flat}", "mission.depth: 41 m is not between the surface and the sea floor at 40 m"),
        ("{kind: slope, gradient: 0.1, direction_deg: 180}", "sea floor at 35 m"),
    ],
)
def test_a_track_below_the_floor_is_refused(capsys, terrain: str, says: str) -> None:
    """At any of its waypoints."""
    depth = "41" if "flat" in terrain else "36"
    Path("mine.yaml").write_text(
        f"world: {{terrain: {terrain}}}\nvehicle: {{start: {{north: 0, east: 0, depth: 10}}}}\n"
        f"mission: {{kind: track, depth: {depth}, pattern: {POINTS}}}\n"
    )
    assert says in refused(capsys, "run", "mine.yaml")


def grid(depths: np.ndarray, spacing: float = 10.0) -> str:
    """A NetCDF file of depths (n, m) [m]."""
    with h5py.File("floor.nc", "w") as file:
        for name, count in zip(("north", "east"), depths.shape, strict=True):
            axis = file.create_dataset(name, data=spacing * np.arange(count))
            axis.attrs["units"] = "m"
            axis.make_scale(name)
        depth = file.create_dataset("depth", data=depths)
        depth.attrs.update({"units": "m", "standard_name": "sea_floor_depth_below_mean_sea_level"})
        for k, name in enumerate(("north", "east")):
            depth.dims[k].attach_scale(file[name])
    return "floor.nc"


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        ((2, 3), 9999.0, "the depth of 9999 m at north 20 m, east 30 m is a spike"),
        ((1, 2), -60.0, "the depth of -60 m at north 10 m, east 20 m is a spike"),
        ((2, 3), 1e35, "a depth of 1e+35 m is more than that of any sea"),
        (..., -40.0, "all depths are 0 or less, down to -40 m"),
        (..., 0.0, "all depths are 0 or less"),
    ],
)
def test_depths_that_no_sea_has(place, value: float, says: str) -> None:
    """Spikes, fill values, heights; a cliff is none."""
    depths = np.full((5, 7), 40.0)
    depths[place] = value
    with pytest.raises(InputError) as caught:
        build_terrain(DepthGridSettings(file=grid(depths)), 40.0)
    assert str(caught.value).startswith(f"floor.nc: {says}")


def test_a_cliff_and_a_beach_are_real() -> None:
    """A step of 70 m within 10 m, and land at one side."""
    depths = np.full((5, 7), 40.0)
    depths[:, 4:], depths[:, 0] = 110.0, -2.0
    floor = build_terrain(DepthGridSettings(file=grid(depths)), 40.0)
    assert floor.depth(20.0, 60.0) == 110.0


@pytest.mark.parametrize(
    ("start", "inside"),
    [((1.2, 0.0), True), ((-1.2, 0.0), False), ((1.2, 2.0), False), ((40.0, 0.0), False)],
)
def test_a_vehicle_within_a_tube_is_refused(start: tuple[float, float], inside: bool) -> None:
    """Where it touches nothing; not before the mouth, beside the tube or behind it."""
    values = {
        "duration": 0.1,
        "dock": {"model": "dock_tube", "heading_deg": 0.0},
        "vehicle": {"start": {"north": start[0], "east": start[1], "speed": 0.0, "depth": 20.0}},
    }
    if inside:
        with pytest.raises(InputError, match=r"vehicles\.remus100\.start: it is inside 'dock_tube'"):
            run(scenario.parse(values))
    else:
        assert run(scenario.parse(values)).attributes["status"] == "complete"


@pytest.mark.parametrize(("apart", "fits"), [(0.0, False), (0.4, False), (1.4, False), (1.6, True)])
def test_two_docks_at_one_place_are_refused(apart: float, fits: bool) -> None:
    """Mouths of 0.75 m need 1.5 m beside each other."""
    structures = {"west": {}, "east": {"east": apart}}
    start = {"north": -60.0, "east": 0.0}
    values = {"duration": 0.1, "structures": structures, "vehicles": {"auv": {"start": start}}}
    values["vehicles"]["auv"] |= {"mission": {"kind": "docking", "dock": "west"}}
    values["vehicles"]["auv"] |= {"sensors": {"usbl": {"dock": "west"}}}
    if fits:
        assert run(scenario.parse(values)).attributes["status"] == "complete"
        return
    with pytest.raises(InputError, match=r"structures\.east: it overlaps with 'west'"):
        run(scenario.parse(values))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("vehicles: {}", "1: vehicles: give 1 or more, not 0"),
        ("current: {kind: sum, terms: []}", "1: current.terms: give 1 or more, not 0"),
        ("vehicles:\n  aü: {model: remus100}", "2: vehicles.aü: a name is 1 to 64 letters without accents"),
        ("vehicles:\n  a: {}\n  'b c': {}", "3: vehicles.b c: a name is 1 to 64 letters"),
        ("estimator: 3", "1: estimator: 3 should be a mapping"),
        ("mission: {kind: track, pattern: 4}", "1: mission.pattern: 4 should be a mapping"),
        ("mission:\n  kind: manoeuvre", "1: mission.manoeuvre: not given"),
        ("manoeuvre: {rudder_deg: 20}", "1: manoeuvre: kind is not given; there are straight, circle"),
        ("mission: {kind: track, pattern: {kind: ring}}", "1: mission.pattern: no kind 'ring'; there are waypoints"),
        ("sensors:\n  far: {kind: sonar}", "2: sensors.far.kind: no sensor 'sonar'; there are compass"),
        ("current: {kind: sum, terms: [{kind: gust}, {kind: gusts}]}", "1: current.terms.1: no kind 'gusts'; there ar"),
    ],
)
def test_words_of_nested_kinds(capsys, text: str, says: str) -> None:
    """The user's keys with file and line, never the name of a class."""
    Path("mine.yaml").write_text(f"{text}\n")
    line = refused(capsys, "run", "mine.yaml")
    assert line.startswith(f"mine.yaml:{says}")
    assert "Settings" not in line
    assert "Dictionary" not in line
    assert "Tuple" not in line


@pytest.fixture(scope="module")
def track(tmp_path_factory) -> Path:
    """Log of a short track."""
    path = tmp_path_factory.mktemp("track") / "trial.nc"
    values = {"duration": 20.0, "vehicle": {"start": {"north": 0.0, "east": 0.0}}}
    run(scenario.parse({**values, "mission": {"kind": "track", "pattern": {"points": [[5.0, 0.0]]}}}), path=path)
    return path


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ("{}", "pattern: "),
        ("{pattern: {kind: ring}}", "pattern: no kind 'ring'; there are waypoints, lawn_mower"),
        ("{pattern: {points: 3}}", "pattern.points: "),
        ("[1, 2]", "pattern: "),
        ("{pattern: [", "not YAML"),
    ],
)
@pytest.mark.parametrize("command", ["metrics"])
def test_a_log_whose_track_was_edited(track, capsys, settings: str, says: str, command: str) -> None:
    """One line."""
    Path("mine.nc").write_bytes(track.read_bytes())
    with h5py.File("mine.nc", "r+") as file:
        file["vehicles/remus100"].attrs["mission_settings"] = settings
    line = refused(capsys, command, "mine.nc")
    assert line.startswith("log, mission_settings of 'remus100': ") or "mission_settings of 'remus100'" in line
    assert says in line


@pytest.mark.parametrize(("name", "value"), [("position", 1e300), ("nu", -1e12), ("attitude", 1e11)])
def test_a_truth_that_no_run_has(track, capsys, name: str, value: float) -> None:
    """Named with its size."""
    Path("mine.nc").write_bytes(track.read_bytes())
    with h5py.File("mine.nc", "r+") as file:
        file[f"vehicles/remus100/truth/{name}"][3, 0] = value
    assert f"'vehicles/remus100/truth/{name}' has {abs(value):g} in size" in refused(capsys, "metrics", "mine.nc")


@pytest.mark.parametrize("change", ["gone", "changed", "spoiled"])
def test_a_log_is_drawn_and_replayed_with_its_own_models(capsys, monkeypatch, change: str) -> None:
    """From another folder, whatever became of the file; the estimates are those of the run, bit for bit."""
    from auvsim.identification.readers import texts
    from auvsim.replay import trial_logs
    from auvsim.replay.run import replay
    from auvsim.video.playback import Playback

    path = spoiled(Path(), "vehicle", ('model="remus100"', 'model="mine"'))
    found = run(scenario.parse({"duration": 20.0, "vehicle": {"model": path}}), path="trial.nc")
    if change == "gone":
        Path(path).unlink()
        Path("elsewhere").mkdir()
        Path("trial.nc").rename("elsewhere/trial.nc")
        monkeypatch.chdir("elsewhere")
    elif change == "changed":
        Path(path).write_text(Path(path).read_text().replace('data="0.0302437"', 'data="0.0300"'))
    else:
        Path(path).write_text("<mujoco")
    assert Playback(log.read("trial.nc")).model.body("mine/hull").id > 0
    (again,) = replay(trial_logs.recordings(Path("trial.nc"))[0])
    estimated = found.vehicle()["estimate"]
    np.testing.assert_array_equal([e.heading for e in again.estimates], estimated["heading"])
    assert texts([Path("trial.nc")]) == {key: text for key, text in found.models.items() if key[0] == "vehicle"}


def test_logs_of_two_versions_of_a_vehicle_are_told_apart() -> None:
    """One identification is of one vehicle."""
    from auvsim.identification.readers import texts

    path = spoiled(Path(), "vehicle")
    run(scenario.parse({"duration": 1.0, "vehicle": {"model": path}}), path="first.nc")
    spoiled(Path(), "vehicle", ('data="0.0302437"', 'data="0.0302000"'))
    run(scenario.parse({"duration": 1.0, "vehicle": {"model": path}}), path="second.nc")
    with pytest.raises(InputError, match=r"second\.nc: 'mine\.xml' is not as in the other logs"):
        texts([Path("first.nc"), Path("second.nc")])


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("identify --steps segments a.nc b.csv", "identify a.nc b.csv --steps segments"),
        ("identify --steps segments a.nc --quick", "identify a.nc --steps segments --quick"),
        ("estimate --estimator imm my.module:make a.nc", "estimate a.nc --estimator imm my.module:make"),
        ("video --camera follow a.nc --time 1", "video a.nc --camera follow --time 1"),
        ("identify a.nc --holdout b.nc", "identify a.nc --holdout b.nc"),
    ],
)  # fmt: skip
def test_a_log_after_an_option_of_several_names(given: str, meant: str) -> None:
    """Is a log."""
    from auvsim.cli.commands import TAKE_NAMES
    from auvsim.cli.parsing import files_first

    tokens = given.split()
    assert files_first(tokens, TAKE_NAMES[tokens[0]]) == meant.split()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--help"], "--version"),
        (["study", "--help"], "usage: auvsim study"),
        (["scenario", "three_vehicles"], "auv_3"),
    ],
)
def test_what_help_and_scenario_say(capsys, arguments: list[str], says: str) -> None:
    """`--version` is an option, `study` has a usage line, shipped scenarios are found by name."""
    with contextlib.suppress(SystemExit):  # of --help
        assert main(arguments) == 0
    assert says in capsys.readouterr().out


def test_identify_leaves_an_installed_package_alone(monkeypatch) -> None:
    """Names are kept in a checkout's models, or beside a vehicle of the user's own."""
    from auvsim.cli import identify
    from auvsim.vehicles import model_files

    assert identify._target("lake", "remus100").name == "lake.yaml"
    monkeypatch.setattr(model_files, "PACKAGE", model_files.models_folder().parent)
    with pytest.raises(InputError, match="within the installed package"):
        identify._target("lake", "remus100")
    own = spoiled(Path(), "vehicle")
    assert identify._target("lake", str(Path(own).resolve())) == Path.cwd() / "planar" / "lake.yaml"


@pytest.mark.parametrize(
    ("grid", "base"),
    [({"uniform": [0.0]}, {}), ({"choice": [1.0, 2.0]}, {"dock": {"depth": 15.0}}), ({}, {"normal": [0.0, 1.0]})],
)
def test_a_distribution_at_the_top_is_no_scenario(grid: dict, base: dict) -> None:
    """It would replace every key."""
    with pytest.raises(InputError, match=r"(uniform|choice|normal): unknown key"):
        plan.parse({"trials": 2, "base": base, "grid": grid})


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            "mission.leaders [leader_1,nobody]",
            "mission.leaders: no other vehicle 'nobody'; there are leader_1, leader_2,",
        ),
        ("mission.leaders [follower]", "mission.leaders: no other vehicle 'follower'"),
        ("mission.leaders [leader_1,leader_1]", "mission.leaders: leader_1, leader_1 must name each once"),
        ("modem null", "mission.leaders: 'follower' has no modem; give vehicles.follower.modem, or no leaders"),
        ("mission.depth 400", "mission.depth: 400 m is not between the surface and the sea floor at 200 m"),
        (
            "mission {kind: formation, ahead: 150.0, depth: 12.5}",
            "mission: its station is 0.5 m from that of 'leader_1'",
        ),
        ("mission.speed 50", "mission.speed: 50 m/s is more than 'remus100' can hold"),
    ],
)
def test_a_formation_that_cannot_be(capsys, arguments: str, says: str) -> None:
    """Leaders that are not there, stations at one place or in the ground, a speed that no shaft holds."""
    key, value = arguments.split(maxsplit=1)
    line = refused(capsys, "run", "formation", f"--vehicles.follower.{key}", value, "--duration", "4", "--out", "new")
    assert f"vehicles.follower.{says}" in line
    assert not Path("new").exists()


def test_a_track_faster_than_the_shaft(capsys) -> None:
    """It would be run at the most there is, and none would know."""
    line = refused(capsys, "run", "leader_follower", "--vehicles.leader.mission.speed", "50", "--duration", "4")
    assert line.startswith("command line: vehicles.leader.mission.speed: 50 m/s is more than 'remus100' can hold")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ("vehicle nowhere/mine.xml", "model nowhere/mine.xml: there is no such file"),
        ("dock --vehicle.model nowhere.xml", "model nowhere.xml: there is no such file"),
        (
            "dock --world.terrain {kind: generated, center: [3000, 0], spacing: 2.0}",
            "the generated sea floor of 256 m lies",
        ),
    ],
)
def test_what_would_be_silent_or_raw(capsys, arguments: str, says: str) -> None:
    """Files that are not there, a generated floor that nothing is near."""
    assert says in refused(capsys, *arguments.split(maxsplit=2))


@pytest.mark.parametrize(
    ("preset", "key", "value", "own"),
    [("oculus_m750d", "beams", 64, 512), ("blueview_m900", "frequency", 300.0, 900), ("oculus_m750d", "beams", 512, 0)],
)
def test_a_key_beside_a_preset_is_not_passed_over(capsys, preset: str, key: str, value: float, own: int) -> None:
    """One that says the same is taken, as the full form of a log has it."""
    Path("sonar.yaml").write_text(
        f"duration: 1\nsensors: {{mine: {{kind: imaging_sonar, preset: {preset}, {key}: {value}}}}}"
    )
    if not own:
        assert main(["scenario", "sonar.yaml"]) == 0
        return
    says = f"{key}: {value:g} contradicts the preset {preset}, which has {own}; leave one of the two out"
    assert says in refused(capsys, "dock", "sonar.yaml")


def test_a_floor_near_a_start_or_a_dock_is_taken() -> None:
    """Its edge is not the end of the water."""
    scenario.parse({"world": {"terrain": {"kind": "generated", "center": [150.0, 0.0], "spacing": 2.0}}})


@pytest.mark.parametrize("name", ["remus100", "lauv", "bluerov2_heavy"])
def test_a_sheet_does_not_take_a_shipped_name(capsys, name: str) -> None:
    Path("sheet.yaml").write_text(
        f"{{name: {name}, length: 1.6, diameter: 0.19, mass: 31.0, top_speed: 2.5, shaft_rpm: 1500,"
        " fins: {span: 0.086, chord: 0.077, place: 0.69}}"
    )
    line = refused(capsys, "vehicle", "--from", "sheet.yaml", "--out", "mine")
    assert line == f"sheet.yaml: name: '{name}' is a vehicle that auvsim ships; give it a name of its own"
    assert not Path("mine").exists()
