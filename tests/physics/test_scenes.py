"""Scenes that are turned instead of composed anew are the same bit for bit."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.physics import scenes
from auvsim.physics.truth import DockPose
from auvsim.physics.world import WorldSettings, compile_scene, compose
from auvsim.vehicles import library


def content(model: mujoco.MjModel) -> bytes:
    """Everything that MuJoCo keeps of a model."""
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


@pytest.mark.parametrize(
    ("pose", "settings", "rate"),
    [
        (DockPose(depth=20.0, heading=0.0), WorldSettings(), 100.0),
        (DockPose(depth=20.0, heading=1.2345678901234567), WorldSettings(), 100.0),
        (DockPose(depth=20.0, heading=-2.9, roll=0.1, pitch=-0.2), WorldSettings(), 100.0),
        (DockPose(depth=11.3, heading=0.7), WorldSettings(integrator="RK4", sea_floor=33.0), 200.0),
        (DockPose(depth=39.0, heading=0.7), WorldSettings(), 100.0),  # too near the floor for a pillar
    ],
)
def test_the_same_as_composed_anew(pose: DockPose, settings: WorldSettings, rate: float) -> None:
    """Byte for byte, whatever was composed before."""
    anew = compile_scene(compose(library.vehicle("remus100"), library.dock("dock"), pose, settings, rate))
    for _ in range(2):
        scene = scenes.compiled("remus100", "dock", pose, settings, rate)
        assert content(scene.model) == content(anew)
        scene.model.body_mass[:] = 1.0  # what is done to one scene does not reach the next


def test_refuses_what_there_is_not() -> None:
    """An error leaves nothing behind that a later scene would trip over."""
    pose, settings = DockPose(depth=20.0, heading=0.0), WorldSettings()
    for _ in range(2):
        with pytest.raises(InputError, match="no vehicle 'remus'; there are "):
            scenes.compiled("remus", "dock", pose, settings, 100.0)
    assert scenes.compiled("remus100", "dock", pose, settings, 100.0).vehicle.name == "remus100"
