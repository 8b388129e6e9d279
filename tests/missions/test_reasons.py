"""Where docking gives up, the reason it states is the true one, judged from the truth in the log."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest

from auvsim.data.log import Log
from auvsim.missions.docking import reasons
from auvsim.missions.docking.reasons import Judgement, judge
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run
from auvsim.studies.envelope import CONDITIONS

EAST = {"kind": "uniform", "direction_deg": {"uniform": [-180.0, 180.0]}}
BEACONS = {"a": [70.0, 15.0, 38.0], "b": [-50.0, 60.0, 38.0], "c": [-25.0, -75.0, 38.0]}
RANGES = {f"range_{k}": {"kind": "range", "beacon": place, "rate": 0.5} for k, place in BEACONS.items()}
HARD: dict[str, Any] = {
    "current too strong": {"current": {**EAST, "speed": 2.6}},
    "bad day": CONDITIONS["bad day"],
    "worse day": {
        "current": {
            "kind": "sum",
            "terms": [{**EAST, "speed": 0.6}, {"kind": "gust", "correlation_time": 30.0, "intensity": 0.25}],
        },
        "sensors": {"usbl": {"interval": 12.0, "outlier_probability": 0.2}},
        "acoustics": {"dropout_probability": 0.5, "delay": 4.0},
    },
    "dock's clock ahead": {"acoustics": {"clock_offset": 50.0}},
    "dock's clock behind": {"acoustics": {"clock_offset": -60.0}},
    "dock's clock 8 s behind": {"acoustics": {"clock_offset": -8.0}},  # its fixes are not too old to be used
    "fixes silent": {"acoustics": {"dropout_probability": 0.98}},
    "ranges alone, gauge wrong": {"sensors": {"usbl": {"enabled": False}, **RANGES, "depth": {"bias": 4.0}}},
}


@cache
def flown(condition: str, seed: int, trial: int) -> Log:
    """The log of a trial."""
    plan = sampling.merge(sampling.default_plan(), HARD[condition])
    return run(scenario.parse(sampling.draw(plan, seed, trial)), seed=seed, trial=trial)


def given(log: Log, vehicle: str | None = None) -> tuple[Judgement, ...]:
    """Its reasons, judged."""
    return judge(log.vehicle(vehicle) if vehicle else log.vehicle())


@pytest.mark.parametrize(
    ("condition", "trial", "says"),
    [
        ("current too strong", 0, "current too strong"),  # drifts off on its way to the gate
        ("current too strong", 2, "current too strong"),  # stands still on the approach
        ("dock's clock ahead", 0, "the dock's clock is off"),
        ("dock's clock 8 s behind", 0, "the dock's clock is off by -"),
        ("fixes silent", 2, "no fix for 180 s"),
        ("ranges alone, gauge wrong", 0, "entrance passed without capture"),  # above the dock, and nothing shows it
    ],
)
def test_the_reason_for_giving_up_is_true(condition, trial, says):
    last = given(flown(condition, 6, trial))[-1]
    assert last.kind == "aborted"
    assert says in last.text
    assert last.true, last


def test_a_vehicle_jammed_beside_the_funnel_says_so_and_docks_later():
    log = flown("bad day", 6, 12)
    ((text, true),) = [(one.text, one.true) for one in given(log) if one.kind == "jammed"]
    assert text.startswith("beside the funnel")
    assert true
    assert "docked" in log.vehicle()["event"]["kind"]


def test_an_occupied_dock_is():
    values = {
        "duration": 200.0,
        "structures": {"dock": {"north": 90.0, "east": 5.0, "heading_deg": 0.0, "depth": 20.0}},
        "vehicles": {
            name: {
                "mission": {"kind": "docking", "gate_distance": 60.0},
                "start": {"north": north, "east": 5.0, "depth": 20.0, "heading_deg": 0.0, "speed": 1.5},
            }
            for name, north in (("first", 0.0), ("second", -60.0))
        },
    }
    log = run(scenario.parse(values), seed=6)
    (one,) = given(log, "second")
    assert (one.text, one.true) == ("the dock is occupied by 'first'", True)
    assert not reasons._verdict(reasons._Moment(log.vehicle("first"), one.time), "the dock is occupied by 'second'")[0]


@pytest.mark.parametrize(
    ("condition", "trial", "false"),
    [
        ("current too strong", 0, "no progress, {gate:.0f} m from the gate"),  # true to the letter, and not the reason
        ("current too strong", 0, "current too strong for this vehicle: 1.20 m/s, it makes 0.90 m/s"),
        ("dock's clock ahead", 0, "no fix for 180 s"),
        ("dock's clock ahead", 0, "the dock's clock is off by -8.0 s: no fix for 180 s"),
        ("fixes silent", 2, "the dock's clock is off by +2.5 s: no fix for 180 s"),
        ("fixes silent", 2, "no fix for 180 s: 33 refused, future: the dock's clock is off"),
        ("fixes silent", 2, "no fix for 900 s"),
        ("ranges alone, gauge wrong", 0, "current too strong for this vehicle: 0.20 m/s, it makes 2.55 m/s"),
        ("ranges alone, gauge wrong", 0, "not captured within 60 s of the last metres: jammed in the funnel at +1.0 m"),
        ("ranges alone, gauge wrong", 0, "2.0 m below the dock"),
        ("ranges alone, gauge wrong", 0, "it did not like to"),
    ],
)  # fmt: skip
def test_a_false_reason_is_found_out(condition, trial, false):
    log = flown(condition, 6, trial).vehicle()
    end = judge(log)[-1].time
    moment = reasons._Moment(log, end)
    gate = moment.guidance["gate_distance"]
    away = ((moment.along + gate) ** 2 + moment.cross**2) ** 0.5
    assert not reasons._verdict(moment, false.format(gate=away))[0]


def placed(along: float, cross: float, below: float = 0.0, touched: bool = False) -> Any:
    """A moment with the nose at a place in the dock's frame."""
    return SimpleNamespace(
        along=along, cross=cross, below=below, off=(cross**2 + below**2) ** 0.5, radius=0.75, latched=1.3,
        touched=lambda: touched, guidance={"lookahead": 7.0},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("moment", "text", "true"),
    [
        (placed(-5.0, 2.0), "would miss the entrance by 1.10 m", True),
        (placed(-5.0, 1.0), "would miss the entrance by 1.10 m", False),  # line of sight takes back half of it
        (placed(-5.0, 0.2, 2.0), "would miss the entrance by 1.10 m", True),
        (placed(0.3, 1.4), "entrance missed by 1.40 m", True),
        (placed(0.3, 0.4), "entrance missed by 1.40 m", False),
        (placed(3.0, 0.4), "entrance passed without capture", True),
        (placed(0.9, 1.0), "entrance passed without capture", True),
        (placed(0.9, 0.2), "entrance passed without capture", False),
        (placed(-7.0, 5.0), "entrance passed without capture", False),
        (placed(0.5, 0.2, touched=True), "not captured within 60 s of the last metres: jammed in the funnel at", True),
        (placed(0.5, 0.2), "not captured within 60 s of the last metres: jammed in the funnel at", False),
        (placed(0.5, 0.2), "not captured within 60 s of the last metres: hovering at", True),
        (placed(0.5, 0.2, touched=True), "not captured within 60 s of the last metres: hovering at", False),
        (placed(1.3, 0.2, touched=True), "beside the funnel: the nose at +1.3 m, 0.2 m off the axis", True),
        (placed(1.3, 0.2), "beside the funnel: the nose at +1.3 m, 0.2 m off the axis", False),
        (placed(1.3, 1.2, touched=True), "beside the funnel: the nose at +1.3 m, 0.2 m off the axis", False),
        (placed(-90.0, 0.0, -3.0), "3.2 m above the dock; attempt 2 anew", True),
        (placed(-90.0, 0.0, -3.0), "3.2 m below the dock; attempt 2 anew", False),
        (placed(-90.0, 0.0, -3.0), "not docked within 1200 s, waits at the gate: 3.2 m above the dock", True),
        (placed(-90.0, 0.0, -3.0), "not docked within 1200 s, waits at the gate: 6.2 m above the dock", False),
    ],
)
def test_places_at_the_dock_are_judged_by_the_nose(moment, text, true):
    assert reasons._verdict(moment, text)[0] is true


@pytest.mark.slow
def test_nine_of_ten_reasons_for_giving_up_are_true():
    found = {name: [given(flown.__wrapped__(name, 1823, trial))[-1:] for trial in range(10)] for name in HARD}
    ends = [one for trials in found.values() for last in trials for one in last if one.kind in ("aborted", "timeout")]
    false = [one for one in ends if not one.true]
    print(f"{len(ends)} gave up, {len(false)} for a reason that is false")
    assert len(ends) > 40
    assert len(false) <= 0.1 * len(ends), false
