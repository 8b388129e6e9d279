"""Scenes that are moved and turned instead of composed anew are the same bit for bit."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.physics import scenes
from auvsim.physics.scenes import WorldSettings, compile_scene, compose
from auvsim.physics.truth import StructurePose as Pose
from auvsim.vehicles import library, model_files


def content(model: mujoco.MjModel) -> bytes:
    """Everything that MuJoCo keeps of a model."""
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


@pytest.mark.parametrize(
    ("pose", "settings", "rate"),
    [
        (Pose(depth=20.0, heading=0.0), WorldSettings(), 100.0),
        (Pose(depth=20.0, heading=1.2345678901234567), WorldSettings(), 100.0),
        (Pose(depth=20.0, heading=-2.9, roll=0.1, pitch=-0.2), WorldSettings(), 100.0),
        (Pose(depth=11.3, heading=0.7), WorldSettings(integrator="RK4", sea_floor=33.0), 200.0),
        (Pose(depth=39.0, heading=0.7), WorldSettings(), 100.0),  # too near the floor for a pillar
        (Pose(north=120.7, east=-33.1, depth=17.3, heading=2.2, pitch=0.1), WorldSettings(), 100.0),
    ],
)
def test_the_same_as_composed_anew(pose: Pose, settings: WorldSettings, rate: float) -> None:
    """Byte for byte, whatever was composed before."""
    anew = compile_scene(
        compose({"auv": library.vehicle("remus100")}, {"dock": (library.structure("dock"), pose)}, settings, rate)
    )
    for _ in range(2):
        scene = scenes.scene({"auv": "remus100"}, {"dock": ("dock", pose)}, settings, rate)
        assert content(scene.model) == content(anew)
        scene.model.body_mass[:] = 1.0  # what is done to one scene does not reach the next


def test_a_fleet_is_the_same_as_composed_anew() -> None:
    """Two vehicles and two docks, one of which is too near the floor for a pillar, after others of another place."""
    settings, fleet = WorldSettings(), {"auv_1": "remus100", "auv_2": "remus100"}
    for shift in (0.0, 12.3):
        poses = {
            "west": Pose(north=50.0 + shift, east=-80.0, depth=20.0 - shift, heading=0.4),
            "east": Pose(north=-7.7, east=61.0 - shift, depth=39.0, heading=-1.9),
        }
        anew = compose(
            {name: library.vehicle(model) for name, model in fleet.items()},
            {name: (library.structure("dock"), pose) for name, pose in poses.items()},
            settings,
            100.0,
        )
        scene = scenes.scene(fleet, {name: ("dock", pose) for name, pose in poses.items()}, settings, 100.0)
        assert content(scene.model) == content(compile_scene(anew))
        assert scene.poses == poses


def test_a_pillar_stands_on_the_floor_below_its_own_structure() -> None:
    pose = Pose(north=120.7, east=-33.1, depth=17.3, heading=2.2)
    model = scenes.scene({}, {"dock": ("dock", pose)}, WorldSettings(sea_floor=31.0), 100.0).model
    pillar = model.geom("dock:pillar")
    behind = 1.03923 + 0.3  # the cone's end and 0.3 m more [m]
    north, east = 120.7 + behind * np.cos(2.2), -33.1 + behind * np.sin(2.2)
    assert pillar.pos == pytest.approx([north, -east, -0.5 * (17.3 + 1.6 + 31.0)], abs=1e-9)
    assert pillar.size[1] == pytest.approx(0.5 * (31.0 - 17.3 - 1.6), abs=1e-9)


def test_a_model_file_that_changes_makes_another_scene(tmp_path) -> None:
    path = tmp_path / "mine.xml"
    text = (model_files.models_folder() / "remus100" / "remus100.xml").read_text(encoding="utf-8")
    masses = []
    for mass in ("30.87", "31.5"):
        path.write_text(text.replace('mass="30.87"', f'mass="{mass}"'), encoding="utf-8")
        model = scenes.scene({"mine": str(path)}, {}, WorldSettings(), 100.0).model
        masses.append(model.body("mine/hull").mass[0])
    assert masses == [30.87, 31.5]


@pytest.mark.parametrize(
    ("fleet", "docks", "expected"),
    [
        (["a/b"], ["dock"], "instance name 'a/b': give letters, digits, '_', '.' or '-'"),
        ([""], [], "instance name '': give letters"),
        (["sea_floor"], [], "instance name 'sea_floor' is the sea floor's"),
        (["dock"], ["dock"], "instance name 'dock' is used 2 times; give each its own"),
    ],
)
def test_names_that_do_not_tell_things_apart_are_refused(fleet, docks, expected) -> None:
    with pytest.raises(InputError) as caught:
        scenes.scene(
            dict.fromkeys(fleet, "remus100"),
            {name: ("dock", Pose(depth=20.0, heading=0.0)) for name in docks},
            WorldSettings(),
            100.0,
        )
    assert str(caught.value).startswith(expected)


def test_refuses_what_there_is_not() -> None:
    """An error leaves nothing behind that a later scene would trip over."""
    docks, settings = {"dock": ("dock", Pose(depth=20.0, heading=0.0))}, WorldSettings()
    for _ in range(2):
        with pytest.raises(InputError, match="no vehicle 'remus'; there are "):
            scenes.scene({"auv": "remus"}, docks, settings, 100.0)
    assert scenes.scene({"auv": "remus100"}, docks, settings, 100.0).vehicles["auv"].model == "remus100"
