"""The camera for a dock's light: geometry against an independent rotation, its errors, where it sees nothing."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2
from surroundings import WATER, Around

from auvsim.base.errors import InputError
from auvsim.base.frames import euler_to_quaternion, wrap
from auvsim.base.randomness import stream
from auvsim.navigation.measurements import measurements
from auvsim.physics.truth import StructurePose, Truth
from auvsim.sensors.light import Light, LightSettings
from auvsim.simulation import scenario
from auvsim.simulation.sensor_settings import on_board
from estimators.core.types import Measurement
from estimators.docking.aids import LIGHT, Aids
from estimators.docking.models import PlanarModels
from estimators.docking.noise import Bias, DockingNoise
from estimators.planar.model import PRESTERO

CAMERA, ATTITUDE, PLACE = (0.7, -0.15, 0.1), (0.2, -0.15, 2.3), (-3.0, 5.0, 21.0)  # roll, pitch, yaw
DOCK = StructurePose(north=-8.0, east=11.5, depth=19.5, heading=2.0, pitch=0.1, roll=-0.05)
EXACT: dict[str, Any] = {"noise_deg": 0.0, "bias_deg": 0.0, "dropout_probability": 0.0}
COUNT = 20_000


def around(*docks: StructurePose) -> Around:
    """A world with docks."""
    return Around(structures={f"dock{k}": SimpleNamespace(pose=pose) for k, pose in enumerate(docks)})


def truth(attitude: tuple = ATTITUDE, place: tuple = PLACE, time: float = 3.0) -> Truth:
    """A vehicle that pitches, rolls and heads somewhere."""
    return Truth(
        time=time, position=np.array(place), quaternion=euler_to_quaternion(*attitude), attitude=np.array(attitude),
        nu=np.zeros(6), current=np.zeros(3), actuators=np.zeros(5),
    )  # fmt: skip


def camera(trial: int = 0, **settings: Any) -> Light:
    """A sensor of a trial, under a name of its own."""
    return Light(LightSettings(camera=CAMERA, **settings), stream(5, trial, "auv/eye"), name="eye")


def ray() -> np.ndarray:
    """From the camera to the light in the vehicle's axes, by scipy's rotation [m]."""
    turned = Rotation.from_euler("ZYX", ATTITUDE[::-1])
    return turned.inv().apply(DOCK.position - np.array(PLACE) - turned.apply(CAMERA))


def test_an_exact_camera_sees_the_light_where_it_is():
    """Its angles point along the ray; azimuth is to starboard, elevation above the bow."""
    reading = camera(**EXACT).measure(truth(), around(DOCK))
    assert reading is not None
    assert reading.sensor == "eye"
    azimuth, elevation = reading.value
    found = (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), -math.sin(elevation))
    assert found == pytest.approx(ray() / np.linalg.norm(ray()), abs=1e-12)
    ahead = StructurePose(north=10.0, east=1.0, depth=28.0, heading=0.0)  # to starboard and above
    level = camera(**EXACT).measure(truth((0.0, 0.0, 0.0), (0.0, 0.0, 30.0)), around(ahead))
    assert level is not None
    assert min(level.value) > 0.0


def test_errors_are_those_of_the_settings():
    """White noise about a bias of the trial, of each angle on its own: in their central 1 - 2e-5 intervals."""
    made, world = camera(noise_deg=2.0, bias_deg=3.0, dropout_probability=0.0), around(DOCK)
    exact = camera(**EXACT).measure(truth(), world)
    assert exact is not None
    values = np.array([reading.value for _ in range(COUNT) if (reading := made.measure(truth(), world))])
    errors = values - exact.value - made.bias
    sigma = math.radians(2.0)
    assert np.abs(errors.mean(axis=0)).max() < 4.3 * sigma / math.sqrt(COUNT)
    low, high = chi2.ppf([1e-5, 1 - 1e-5], COUNT)
    for column in errors.T:
        assert low < np.sum(column**2) / sigma**2 < high
    assert abs(float(np.mean(errors[:, 0] * errors[:, 1]))) / sigma**2 < 4.3 / math.sqrt(COUNT)
    biases = np.array([camera(trial, bias_deg=3.0).bias for trial in range(1000)])
    low, high = chi2.ppf([1e-5, 1 - 1e-5], 1000)
    for column in biases.T:
        assert low < np.sum(column**2) / math.radians(3.0) ** 2 < high


def test_a_loss_changes_no_other_reading():
    """A share of readings is lost; those that come are as if none were, also after a time without a light."""
    whole, holed, world = camera(dropout_probability=0.0), camera(dropout_probability=0.3), around(DOCK)
    lost = 0
    for tick in range(2000):
        first = whole.measure(truth(time=float(tick)), world)
        second = holed.measure(truth(time=float(tick)), WATER if tick < 100 else world)
        assert first is not None
        if tick >= 100 and second is not None:
            assert second.value.tobytes() == first.value.tobytes()
        lost += tick >= 100 and second is None
    low, high = binom.ppf([1e-5, 1 - 1e-5], 1900, 0.3)
    assert low <= lost <= high


@pytest.mark.parametrize("key", ["minimum_range", "maximum_range", "field_of_view_deg"])
def test_it_sees_within_its_limits_only(key: str):
    """On either side of each limit."""
    distance = float(np.linalg.norm(ray()))
    angle = 2.0 * math.degrees(math.acos(ray()[0] / distance))
    at, inside = {"minimum_range": (distance, -1e-6), "maximum_range": (distance, 1e-6)}.get(key, (angle, 1e-6))

    def limit(by: float) -> dict[str, Any]:
        return {key: at + by}

    assert camera(**EXACT, **limit(inside)).measure(truth(), around(DOCK)) is not None
    assert camera(**EXACT, **limit(-inside)).measure(truth(), around(DOCK)) is None


def test_the_light_shines_out_of_the_mouth_and_the_nearest_is_found():
    """A dock that faces away is not seen, nor does one beyond the nearest count."""
    away = StructurePose(north=DOCK.north, east=DOCK.east, depth=DOCK.depth, heading=DOCK.heading + math.pi)
    eye = camera(**EXACT)
    assert eye.measure(truth(), around(away)) is None
    assert eye.measure(truth(), WATER) is None
    farther = StructurePose(north=-9.0, east=15.0, depth=19.0, heading=2.0)
    one, two = (eye.measure(truth(), around(*docks)) for docks in ((DOCK,), (farther, DOCK)))
    assert one is not None
    assert two is not None
    assert two.value.tobytes() == one.value.tobytes()


def test_the_filter_expects_what_a_tilted_vehicle_sees():
    """Levelled by roll and pitch, an exact reading is what the planar model shows of the true state.

    The camera's height on the hull moves it sideways by 0.1 m x sin(roll) = 0.02 m at 7 m, which the model leaves out.
    """
    bias = Bias(0.01)
    noise = DockingNoise(biases={"compass": bias, "light_eye": bias})
    model = PlanarModels(PRESTERO, noise, aids=Aids(lights={"eye": CAMERA[:2]})).aids[LIGHT, "eye"]
    reading = camera(**EXACT).measure(truth(), around(DOCK))
    assert reading is not None
    roll, pitch, yaw = ATTITUDE
    (made,) = measurements(reading, camera(noise_deg=0.7).settings, PLACE[2], tilt=(pitch, roll))
    assert math.sqrt(made.covariance[0, 0]) == pytest.approx(math.radians(0.7))
    north, east = np.array(PLACE[:2]) - DOCK.position[:2]
    x = np.array([north, east, yaw, 1.2, 0.1, 0.02, 0.1, -0.2, 0.03, 0.0])
    assert abs(wrap(float(made.value[0] - model.evaluate(x, made)[0]))) < 0.02 / 7.0 + 0.002
    x[9] = 0.05
    by_hand = math.atan2(
        -east - math.sin(yaw) * CAMERA[0] - math.cos(yaw) * CAMERA[1],
        -north - math.cos(yaw) * CAMERA[0] + math.sin(yaw) * CAMERA[1],
    )
    assert wrap(float(model.evaluate(x, made)[0]) - (by_hand - yaw + 0.05)) == pytest.approx(0.0, abs=1e-12)
    steps = 1e-6 * np.eye(x.size)
    numeric = np.array([(model.evaluate(x + h, made) - model.evaluate(x - h, made)) / 2e-6 for h in steps]).T
    assert model.jacobian(x, made) == pytest.approx(numeric, abs=1e-6)
    assert numeric[0, 9] == pytest.approx(1.0)
    turn = Measurement(kind=LIGHT, value=made.value + math.tau, covariance=made.covariance, stamp=0.0, received=0.0)
    assert model.residual(turn.value, made.value) == pytest.approx([0.0], abs=1e-12)


def test_a_camera_named_as_its_kind_is_on_board_once():
    """Its name is also that of a kind."""
    lone = scenario.parse({"sensors": {"light": {"kind": "light"}}}).lone[1]
    assert [name for name, _ in on_board(lone.sensors)] == ["compass", "depth", "feedback", "light"]


def test_wrong_settings_are_one_line():
    """With the key and what would be right."""
    for values, text in (
        ({"maximum_range": 0.5}, "maximum_range must be more than minimum_range, 1 m"),
        ({"field_of_view_deg": 200.0}, "less than or equal to 170"),
        ({"rate": 3.0}, "use 2 or 5 Hz"),
    ):
        with pytest.raises(InputError, match=text) as error:
            scenario.parse({"sensors": {"light": {"kind": "light", **values}}})
        assert "\n" not in str(error.value)
