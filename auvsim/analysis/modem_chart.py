"""A modem's chart: packets lost by overlap, age of what is known of the leader, and the bound, over a fleet's size.

Modems at rest on a circle about a leader share the water in a run of the network alone. Ranging is one-way, where the
leader and all followers tell their state once a period, or two-way, where each follower asks the leader once a period.
The bound is that of the shipped scenario `leader_follower` with that modem, the leader's packets as frequent and as
often lost as in the run.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from auvsim.acoustics.access import FreeSettings, TdmaSettings
from auvsim.acoustics.clock import ClockSettings
from auvsim.acoustics.message import Delivery, Fate
from auvsim.acoustics.modem import AskSettings, ModemSettings, TellSettings
from auvsim.acoustics.modems import UNDER_WAY, Equipment, Modems, SoundSettings, build_modems
from auvsim.acoustics.payload import NUMBERS, REQUEST, STATE, StateReport, packet_bits
from auvsim.acoustics.presets import PRESETS
from auvsim.analysis.mission_bounds import mission_bounds
from auvsim.analysis.style import dress
from auvsim.base.randomness import stream
from auvsim.physics.truth import Truth
from auvsim.simulation.loading import load_scenario

TICK = 0.25  # between two looks at the modems [s]
DEPTH, FLOOR = 20.0, 200.0  # of all modems, of the sea floor [m]
LEADER = "leader"
AFTER = 500.0  # from when on the bound counts, as long as `leader_follower` takes to settle [s]
OVERLAPS = ("collision", "transmitting")  # fates of packets that others or the receiver's own overlap
Access = Literal["ALOHA", "TDMA"]
Ranging = Literal["one-way", "two-way"]


class Fleet(NamedTuple):
    """What a point of the chart is of."""

    modem: str  # preset
    followers: int
    period: float  # asked for [s]
    access: Access
    ranging: Ranging
    distance: float  # from the leader to each follower [m]


class Point(NamedTuple):
    """What became of it."""

    fleet: Fleet
    period: float  # between two of the leader's packets to a follower, lost ones included [s]
    collisions: float  # share of all packets, for the receivers they are meant for, that are lost by overlap
    lost: float  # share of those with the leader's state that a follower does not receive, for any reason
    age: float  # mean age of the newest state of the leader that a follower has [s]; infinite: none came
    bound: float  # least rms error of a follower's position [m]


def chart(fleets: Sequence[Fleet], duration: float, seed: int, progress: Callable[[float, float], None]) -> list[Point]:
    """The points of a chart.

    Args:
        fleets: What is compared.
        duration: Of each run [s].
        seed: Of all randomness.
        progress: Called with what is done and the total of it.
    """
    points = []
    for k, fleet in enumerate(fleets):
        points.append(point(fleet, duration, seed))
        progress(k + 1, len(fleets))
    return points


def point(fleet: Fleet, duration: float, seed: int) -> Point:
    """One point of the chart; a follower's numbers are means over all of them."""
    period, collisions, lost, age = heard(fleet, *run(fleet, duration, seed), duration)
    return Point(fleet, period, collisions, lost, age, bound(fleet, period, lost))


def slot(fleet: Fleet) -> float:
    """Length of a slot [s] of TDMA that holds what a modem sends, its reply if it asks, and their travel."""
    settings, reach = _settings(fleet.modem), 2.0 * fleet.distance
    modem, sound = settings.modem, settings.sound_speed
    needed = modem.duration(packet_bits(NUMBERS[STATE])) + reach / sound
    if fleet.ranging == "two-way":
        needed += _turn_around(fleet) + fleet.distance / sound
    return math.ceil(100.0 * needed) / 100.0


def run(fleet: Fleet, duration: float, seed: int) -> tuple[list[Fate], dict[str, list[Delivery]]]:
    """Fates of all packets, and what each follower received."""
    names = [LEADER, *(f"follower_{k + 1}" for k in range(fleet.followers))]
    places = {name: _place(k, fleet) for k, name in enumerate(names)}
    asks = fleet.ranging == "two-way"
    equipment = {}
    for k, name in enumerate(names):
        # Modems that nothing coordinates begin anywhere within the period and do not keep it to the second.
        phase = fleet.period * (0.5 + k / len(names)) if fleet.access == "ALOHA" else 0.0
        spread = 0.5 * fleet.period if fleet.access == "ALOHA" else 0.0
        ask, tell = AskSettings(), TellSettings()
        if not asks:
            tell = TellSettings(period=fleet.period, phase=phase, jitter=spread)
        elif name != LEADER:
            ask = AskSettings(whom=LEADER, period=fleet.period, phase=phase, jitter=spread)
        modem = _settings(fleet.modem).model_copy(update={"turn_around": _turn_around(fleet), "tell": tell, "ask": ask})
        equipment[name] = Equipment(modem, ClockSettings())
    access = TdmaSettings(slot=slot(fleet), reach=2.0 * fleet.distance) if fleet.access == "TDMA" else FreeSettings()
    sound = SoundSettings(access=access)

    def report(name: str, time: float, stamp: float) -> StateReport:
        return StateReport(stamp, *places[name].tolist(), *(0.0,) * 10)

    modems = build_modems(
        sound, equipment, sound.medium(lambda *_: FLOOR), lambda name: stream(seed, 0, name), report, TICK
    )
    assert modems is not None
    return _carried(modems, places, duration)


def _carried(
    modems: Modems, places: dict[str, np.ndarray], duration: float
) -> tuple[list[Fate], dict[str, list[Delivery]]]:
    fates, received = [], {name: [] for name in places}
    still, upright = np.zeros(6), np.array((1.0, 0.0, 0.0, 0.0))

    def truths(time: float) -> dict[str, Truth]:
        return {
            name: Truth(time, place, upright, np.zeros(3), still, np.zeros(3), np.zeros(1))
            for name, place in places.items()
        }

    before = truths(0.0)
    for k in range(1, round(duration / TICK) + 1):
        now = truths(k * TICK)
        fates += modems.advance(before, now)
        for name in places:
            received[name] += modems.deliver(name, k * TICK)
        before = now
    return fates, received


def heard(
    fleet: Fleet, fates: Sequence[Fate], received: dict[str, list[Delivery]], duration: float
) -> tuple[float, float, float, float]:
    """Period [s], shares lost by overlap and in all, and mean age [s], see `Point`."""
    decided = [fate for fate in fates if fate.fate != UNDER_WAY]
    collisions = sum(fate.fate in OVERLAPS for fate in decided) / max(1, len(decided))
    ages, arrived = [], 0
    for name in received:
        if name == LEADER:
            continue
        told = [d for d in received[name] if d.message.source == LEADER and d.message.kind == STATE]
        arrived += len(told)
        ages.append(mean_age([(d.received, d.message.sent) for d in told], duration))
    if fleet.ranging == "one-way":
        tried = sum(f.message.source == LEADER for f in decided)
    else:  # what a follower asks for is lost if either its question or the reply is
        tried = sum(f.message.kind == REQUEST for f in decided)
    each = tried / fleet.followers
    lost = 1.0 - min(1.0, arrived / tried) if tried else 1.0
    return duration / each if each else math.inf, collisions, lost, float(np.mean(ages))


def mean_age(told: Sequence[tuple[float, float]], duration: float) -> float:
    """Mean age [s] of the newest state from the first reception to the end.

    Args:
        told: When each state was received and from when it is [s], in order of reception.
        duration: Up to when [s].
    """
    if not told:
        return math.inf
    area, newest = 0.0, -math.inf
    for (begin, stamp), (end, _) in zip(told, [*told[1:], (duration, math.nan)], strict=True):
        newest = max(newest, stamp)
        area += (end - begin) * (0.5 * (begin + end) - newest)
    return area / (duration - told[0][0]) if duration > told[0][0] else math.inf


def bound(fleet: Fleet, period: float, lost: float) -> float:
    """Least rms error [m] of the follower of `leader_follower`; infinite if all is lost."""
    if lost >= 1.0 or not math.isfinite(period):
        return math.inf
    often = {"period": period, "phase": 0.5 * period}
    asks = fleet.ranging == "two-way"
    modem = {"preset": fleet.modem, "turn_around": _turn_around(fleet)}
    leader = modem | {"tell": {"period": None} if asks else often}
    follower = modem | ({"ask": {"whom": LEADER, **often}} if asks else {})
    keys = {"leader": {"modem": leader}, "follower": {"modem": follower}}
    scenario = load_scenario("leader_follower", vehicles=keys, network={"dropout_probability": lost})
    found = mission_bounds(scenario, moved=LEADER, side=3, span=400.0, after=AFTER)[0]
    m, n = (int(np.abs(a - x).argmin()) for a, x in zip((found.north, found.east), found.start, strict=True))
    return float(found.settled[m, n])


def _settings(preset: str) -> ModemSettings:
    return ModemSettings.model_validate({"preset": preset})


def _turn_around(fleet: Fleet) -> float:
    """Time [s] that suffices to decode a question before the reply."""
    modem = PRESETS[fleet.modem]
    needed = modem.duration(packet_bits(NUMBERS[REQUEST])) + modem.processing + modem.processing_jitter + TICK
    return math.ceil(100.0 * (needed + 0.05)) / 100.0


def _place(number: int, fleet: Fleet) -> np.ndarray:
    """The leader in the middle, followers on a circle about it."""
    if number == 0:
        return np.array((0.0, 0.0, DEPTH))
    angle = 2.0 * math.pi * (number - 1) / fleet.followers
    return np.array((fleet.distance * math.cos(angle), fleet.distance * math.sin(angle), DEPTH))


STYLES = {
    ("ALOHA", "one-way"): ("#1f77b4", "-", "o"), ("ALOHA", "two-way"): ("#1f77b4", "--", "s"),
    ("TDMA", "one-way"): ("#d95f02", "-", "o"), ("TDMA", "two-way"): ("#d95f02", "--", "s"),
}  # fmt: skip


def draw(points: Sequence[Point]) -> Figure:
    """The chart: a panel each for shares lost, age and bound, a line for each way of access and ranging."""
    figure = Figure(figsize=(13.0, 4.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for key, (colour, line, mark) in STYLES.items():
        mine = [p for p in points if (p.fleet.access, p.fleet.ranging) == key]
        counts = [p.fleet.followers for p in mine]
        drawn = {"color": colour, "ls": line, "marker": mark, "ms": 4, "label": ", ".join(key)}
        for axes, values in zip(panels, _panels(mine), strict=True):
            axes.plot(counts, values, **drawn)
    first = points[0].fleet
    titles = ("packets lost by overlap", "mean age of the leader's state", "Cramér-Rao bound, position rms")
    for axes, title, label in zip(panels, titles, ("[%]", "[s]", "[m]"), strict=True):
        dress(axes, title, "followers", label)
        axes.set_ylim(bottom=0.0)
        axes.xaxis.get_major_locator().set_params(integer=True)
    panels[0].legend()
    figure.suptitle(f"{first.modem}: once in {first.period:g} s, {first.distance:g} m from the leader", fontsize=11.5)
    return figure


def _panels(points: Sequence[Point]) -> Iterator[list[float]]:
    yield [100.0 * p.collisions for p in points]
    for values in ([p.age for p in points], [p.bound for p in points]):
        yield [v if math.isfinite(v) else math.nan for v in values]
