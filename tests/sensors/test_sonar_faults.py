"""Bad frames of the imaging sonar: how often, what the gate calls them, and a mission that goes on without them."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom
from surroundings import Around

from auvsim.analysis.bad_frames import bad_frames
from auvsim.analysis.summary import summarise_all
from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.data.log import Log
from auvsim.navigation.gate import Gate
from auvsim.physics.truth import Truth
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings
from auvsim.sensors.sonar_faults import FAULTS, FaultSettings
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import run
from auvsim.vehicles import library
from auvsim.water.terrain import FlatFloor

WORLD = Around(terrain=FlatFloor(20.0))
SHARES = {"empty": 0.05, "not_finite": 0.1, "saturated": 0.02, "wrong_size": 0.08, "missing": 0.06, "late": 0.12}
SMALL: dict[str, Any] = {"beams": 16, "bins": 24}


def sonar(**settings: Any) -> ImagingSonar:
    return ImagingSonar(ImagingSonarSettings(**SMALL, **settings), stream(5, 0, "auv/sonar"), name="eye")


def at(time: float) -> Truth:
    """A vehicle at rest 5 m above the floor."""
    attitude = (0.0, 0.0, 0.4)
    return Truth(
        time=time, position=np.array([1.0, 2.0, 15.0]), quaternion=euler_to_quaternion(*attitude),
        attitude=np.array(attitude), nu=np.zeros(6), current=np.zeros(3), actuators=np.zeros(3),
    )  # fmt: skip


def test_shares_names_and_noise_of_bad_frames() -> None:
    """1000 frames: each kind as often as asked for, refused by its name; good ones are those of a sonar without."""
    clean, faulty = sonar(), sonar(faults=FaultSettings(**SHARES, delay=2.5))
    gate = Gate({"eye": faulty.settings}, library.vehicle("remus100").actuation)
    found: Counter[str] = Counter()
    heard = 0
    for k in range(1000):
        good, reading = clean.measure(at(float(k)), WORLD), faulty.measure(at(float(k)), WORLD)
        assert good is not None
        if reading is None:
            found["missing"] += 1
            continue
        assert reading.sequence == k
        reason = gate.judge(reading)
        late = reading.received == k + 2.5
        assert late or reading.received == k
        found[reason or ("late" if late else "")] += 1
        if not reason:
            np.testing.assert_array_equal(reading.image, good.image)
            heard += 1
    assert heard == found[""] + found["late"]
    for kind in FAULTS:
        low, high = binom.ppf([1e-4, 1.0 - 1e-4], 1000, SHARES[kind])
        assert low <= found[kind] <= high


def test_shares_beyond_all_frames_are_refused() -> None:
    """They sum up to 1 at most."""
    with pytest.raises(ValueError, match=r"sum up to 1\.2, at most 1"):
        FaultSettings(empty=0.5, late=0.7)


def test_a_log_of_frames_takes_each_fault() -> None:
    """What is no number, or not of the sonar's size, is as faint as can be."""
    for kind in FAULTS[:-2]:
        reading = sonar(log_frames=True, faults=FaultSettings(**{kind: 1.0})).measure(at(0.0), WORLD)
        assert reading is not None
        assert reading.value.shape == (16, 24)
        assert reading.value.dtype == np.int8
        assert (reading.value == -128).mean() == pytest.approx(
            {"empty": 1.0, "not_finite": 6 / 16, "saturated": 0.0, "wrong_size": 1.0}[kind]
        )


def mission(faults: dict[str, float]) -> Log:
    """50 s of the shipped survey, its dive after 2 s."""
    own = {"sensors": {"sonar": {**SMALL, "beams": 32, "faults": faults}, "gps": {"first_fix": 0.0}}}
    own |= {"mission": {"fix_time": 2.0}, "start": {"depth": 0.3}, "estimator": {"stride": 1, "keep": 4.0}}
    rough = {"terrain": {"extent": 120.0, "spacing": 1.0, "center": [0.0, 25.0]}}
    return run(load_scenario("survey", duration=50.0, vehicles={"remus100": own}, water=rough), seed=2)


def test_a_mission_counts_names_and_survives_bad_frames() -> None:
    """The log has one fate of each frame; late ones are used where they are not too old."""
    shares = {**dict.fromkeys(FAULTS, 0.08), "late": 0.4}
    log = mission({**shares, "delay": 3.0})
    vehicle = log.vehicle()
    chances = ImagingSonar(
        ImagingSonarSettings(faults=FaultSettings(empty=0.1)), stream(2, 0, "remus100/sonar")
    )._chances
    assert chances is not None
    drawn = Counter(FaultSettings(**shares).of(chances.random()) for _ in range(50))
    frames = vehicle["sonar"]
    assert len(frames["time"]) == 50 - drawn["missing"]
    counted = bad_frames(vehicle)
    assert {kind: counted[kind] for kind in FAULTS} == {kind: drawn[kind] for kind in FAULTS}
    assert summarise_all(log)["bad_frames"] == counted
    events = vehicle["event"]["text"].astype(str)
    for kind in ("empty", "not finite", "saturated", "wrong size"):
        assert any(text == f"readings of sonar: {kind}" for text in events)
    own = vehicle["measurements"]
    late = frames["time"][frames["received"] > frames["time"]]
    fates = own["accepted"][np.isin(own["stamp"], late) & (own["sensor"].astype(str) == "sonar")]
    assert fates.any()
    assert str(log.attributes["status"]) == "complete"
    assert np.isfinite(vehicle["estimate"]["position"]).all()


def test_frames_that_are_too_old_are_counted() -> None:
    """Later than the estimator keeps anything."""
    counted = bad_frames(mission({"late": 0.3, "delay": 6.0}).vehicle())
    assert 0 < counted["too_old"] <= counted["late"]
    assert bad_frames(mission({}).vehicle()) == {}
