"""Records of a trial log whose transponder is off-centre, at a dock that is turned."""

import dataclasses
import math
from pathlib import Path

import numpy as np
from lopsided import TRANSPONDER
from synthetic import DOCK, DOCK_HEADING, trial_log

from auvsim.base.frames import rotation
from auvsim.data import log as logs
from auvsim.identification.log_records import signals
from auvsim.simulation import scenario

TRANSCEIVER = (0.5, -0.4, -1.0)  # in the dock's frame [m]


def test_positions_are_those_of_the_origin(tmp_path: Path) -> None:
    """Fixes without noise of the transponder lead back to the body's origin, to millimetres of interpolated headings.

    The hull's pitch of up to 0.03 rad moves a transponder 0.45 m ahead of the origin by 0.4 mm.
    """
    log = trial_log()
    truth, usbl = log["truth"], log["usbl"]
    dock, packets, places = rotation(0.0, 0.0, DOCK_HEADING), [], []
    for stamp, packet in zip(usbl["time"], usbl["value"], strict=True):
        place = np.array([np.interp(stamp, truth["time"], axis) for axis in truth["position"].T])
        heading = float(np.interp(stamp, truth["time"], np.unwrap(truth["attitude"][:, 2])))
        there = place + rotation(0.0, 0.0, heading) @ TRANSPONDER
        packets.append([*(dock.T @ (there - DOCK) - TRANSCEIVER), *packet[3:]])
        places.append(place[:2])
    times, attitude = truth["time"], truth["attitude"]
    compass = {
        "time": times,
        "received": times,
        "value": attitude[:, ::-1],
        "sequence": np.arange(len(times), dtype=np.int32),
    }
    at = "vehicles/remus100/sensors/"
    own = {at + "usbl": {**usbl, "value": np.array(packets)}, at + "compass": {**log["compass"], **compass}}
    groups = {**log.log.groups, **own}
    plan = scenario.parse({"sensors": {"usbl": {"transponder": TRANSPONDER, "transceiver": TRANSCEIVER}}})
    names = (f"transceiver_{axis}" for axis in ("forward", "starboard", "down"))
    dock_says = {**log.log.group_attributes["structures/dock"], **dict(zip(names, TRANSCEIVER, strict=True))}
    of_groups = {**log.log.group_attributes, "structures/dock": dock_says}
    attributes = {**log.log.attributes, "scenario": scenario.to_yaml(plan)}
    changed = dataclasses.replace(log.log, groups=groups, attributes=attributes, group_attributes=of_groups)
    logs.write(changed, tmp_path / "trial.nc")

    parts, _, vehicle = signals(tmp_path / "trial.nc")
    found = parts[0].signals
    arrived = np.isfinite(usbl["received"])
    assert vehicle == "remus100"
    assert len(found["north"].times) == arrived.sum() > 20
    for name, axis in (("north", 0), ("east", 1)):
        np.testing.assert_allclose(found[name].values, np.array(places)[arrived, axis], atol=2e-3)
    assert math.hypot(*TRANSPONDER[:2]) > 0.5  # what a wrong sign would show
