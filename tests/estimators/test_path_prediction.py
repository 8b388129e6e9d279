"""Methods of cooperative localisation with late pulses and packets: equations, delays, consistency."""

import math

import numpy as np
import pytest

from auvsim.reproduce.paper3 import truths
from auvsim.reproduce.paper3.follow import follow
from auvsim.reproduce.paper3.methods import METHODS, cloning, iiru, real_time
from auvsim.reproduce.paper3.truths import START, STEP, Conditions, simulate, undelayed
from estimators.core.consistency import interval
from estimators.core.models.motion import unicycle
from estimators.core.models.sensors import range_and_bearing
from estimators.core.types import Gaussian, Measurement
from estimators.path_prediction import kinematics
from estimators.path_prediction.bound import Sighting, position_bounds
from estimators.path_prediction.choosing import ChoosingFilter
from estimators.path_prediction.cloning import CloningFilter, interpolated
from estimators.path_prediction.delayed import DelayedFilter
from estimators.path_prediction.follower import DeadReckoning
from estimators.path_prediction.messages import Noise, Packet, Pulse, curved, seen
from estimators.path_prediction.observability import observability
from estimators.path_prediction.real_time import RealTimeFilter
from estimators.path_prediction.statistics import FadingStatistics

NOISE = Noise(0.02, 3e-4)
LEADER_NOISE = Noise(0.003, 1e-5)
FIRST = np.array([31.0, -12.0, 0.7])


def spread(seed, n):
    """A positive definite matrix (n, n) without symmetries."""
    A = np.random.default_rng(seed).standard_normal((n, n))
    return A @ A.T + 0.1 * np.eye(n)


def packet(number, pose, P=START, speed=3.0, yaw_rate=0.0, late=15.0):
    stamp = 10.0 * number
    return Packet(number, stamp, stamp + late, np.asarray(pose, dtype=float), P, speed, yaw_rate)


@pytest.mark.parametrize("forgetting", [0.5, 0.8, 0.95, 0.99])
def test_recursion_of_the_statistics(forgetting):
    """Eq. 10 equals eqs 8 and 9 to rounding."""
    samples = 0.3 + 2.0 * np.random.default_rng(3).standard_normal(60)
    found = FadingStatistics(forgetting)
    for n, sample in enumerate(samples, start=1):
        found.update(sample)
        weights = (1.0 - forgetting) / (1.0 - forgetting**n) * forgetting ** np.arange(n - 1, -1, -1)
        mean = weights @ samples[:n]
        assert found.mean == pytest.approx(mean, abs=1e-12)
        assert found.variance == pytest.approx(weights @ (samples[:n] - mean) ** 2, abs=1e-12)


def test_floor_of_the_statistics_holds_for_few_samples_alone():
    found = FadingStatistics(0.9, floor=2.0, few=3)
    for sample, variance in ((1.0, 2.0), (1.0, 2.0), (1.0, 0.0)):
        found.update(sample)
        assert found.variance == variance


@pytest.mark.parametrize("with_speed", [False, True])
def test_step_of_a_pose_in_a_joint_belief(with_speed):
    """Mean by eq. 1, covariance by finite differences of it, noise by its density; the rest of the belief stays."""
    n, at, w, a, h = 8, 2, 0.03, 0.05, 0.6
    x, P = np.random.default_rng(1).standard_normal(n), spread(2, n)
    qv, qw = 0.04, 0.002

    def moved(x):
        y = x.copy()
        V = x[at + 3] if with_speed else 3.1
        y[at] += h * V * math.cos(x[at + 2])
        y[at + 1] += h * V * math.sin(x[at + 2])
        y[at + 2] += h * w
        y[at + 3] += h * a * with_speed
        return y

    F = np.column_stack([(moved(x + 1e-6 * e) - moved(x - 1e-6 * e)) / 2e-6 for e in np.eye(n)])
    G = np.zeros((n, 2))
    c, s = math.cos(x[at + 2]), math.sin(x[at + 2])
    G[at + 2, 1] = 1.0
    if with_speed:
        G[at + 3, 0] = 1.0
    else:
        G[at, 0], G[at + 1, 0] = c, s
    y, expected = moved(x), F @ P @ F.T + h * G @ np.diag([qv, qw]) @ G.T
    if with_speed:
        kinematics.advance_with_speed(x, P, at, a, w, h, qv, qw)
    else:
        kinematics.advance(x, P, at, 3.1, w, h, qv, qw)
    np.testing.assert_allclose(x, y, atol=1e-12)
    np.testing.assert_allclose(P, expected, atol=1e-8)  # of the differences


def test_noise_over_a_stretch_is_that_of_its_steps():
    """To the order of the step: many short steps against the closed form of white noise on a straight course."""
    x, P, heading = np.array([0.0, 0.0, 0.9]), np.zeros((3, 3)), 0.9
    for _ in range(4000):
        kinematics.advance(x, P, 0, 3.0, 0.0, 10.0 / 4000, *NOISE)
    closed = kinematics.odometry_covariance(heading, 3.0, 10.0, *NOISE)
    np.testing.assert_allclose(P, closed, atol=1e-3 * np.abs(closed).max())


def test_second_order_of_a_heading_error():
    """The mean square of V t (1 - cos d), d normal: small p by the formula, and never less at any p."""
    rng = np.random.default_rng(4)
    for p in (1e-3, 0.1, 1.0, 10.0):
        P, gone = np.diag([0.0, 0.0, p]), np.zeros(2)
        for _ in range(20):
            kinematics.bend(P, 0, gone, 0.6, 3.0, 5.0)
        lost = 300.0 * (1.0 - np.cos(math.sqrt(p) * rng.standard_normal(200_000)))
        along = np.array([math.cos(0.6), math.sin(0.6)])
        assert np.trace(P[:2, :2]) == pytest.approx(along @ P[:2, :2] @ along)
        assert np.trace(P[:2, :2]) > 0.98 * np.mean(lost**2)
        if p < 0.01:
            assert np.trace(P[:2, :2]) == pytest.approx(np.mean(lost**2), rel=0.03)  # of the sample


def test_sight_is_that_of_the_shared_sensor():
    pose, place = np.array([5.0, -7.0, 0.4]), np.array([-31.0, 12.0])
    model = range_and_bearing(unicycle())
    pulse = Pulse(0, 0.0, 1.0, 40.0, 4.0, 0.3, 0.01)
    m = Measurement(
        kind="range_bearing",
        value=np.array([40.0, 0.3]),
        covariance=np.eye(2),
        stamp=0.0,
        received=0.0,
        parameters=(*place, 0.0),
    )
    value, H = model.shown(pose, m)
    found = seen(pulse, pose, place)
    assert found is not None
    np.testing.assert_allclose(found.residual, model.residual(m.value, value), atol=1e-12)
    np.testing.assert_allclose(found.by_follower, H, atol=1e-12)
    np.testing.assert_allclose(found.by_leader, -H[:, :2], atol=1e-12)
    np.testing.assert_allclose(found.covariance, np.diag([4.0, 0.01]))
    for absent, rows in (("range", slice(1, 2)), ("bearing", slice(0, 1))):
        alone = seen(pulse._replace(**{absent: math.nan}), pose, place)
        assert alone is not None
        np.testing.assert_array_equal(alone.residual, found.residual[rows])
        np.testing.assert_array_equal(alone.by_follower, found.by_follower[rows])
        np.testing.assert_array_equal(alone.covariance, found.covariance[rows, rows])
    assert seen(pulse, pose, pose[:2]) is None


def test_second_order_of_a_sight():
    """Mean and variance of range and bearing of a Gaussian place, by sampling; to third order in spread over range."""
    spread_, place = np.array([[900.0, 300.0], [300.0, 400.0]]), np.array([260.0, -150.0])
    places = place + np.random.default_rng(9).multivariate_normal(np.zeros(2), spread_, 400_000)
    pulse = Pulse(0, 0.0, 0.0, 300.0, 1e-9, 0.2, 1e-12)
    found = seen(pulse, np.zeros(3), place)
    assert found is not None
    second = curved(found, pulse, spread_)
    values = np.array([np.hypot(*places.T), np.arctan2(places[:, 1], places[:, 0])])
    mean = np.array([300.0, 0.2]) - second.residual
    assert (np.abs(values.mean(axis=1) - mean) < [0.1, 3e-4]).all()
    S = found.by_leader @ spread_ @ found.by_leader.T + second.covariance
    first = np.diagonal(found.by_leader @ spread_ @ found.by_leader.T)
    np.testing.assert_allclose(values.var(axis=1), np.diagonal(S), rtol=0.03)
    assert abs(values.mean(axis=1)[0] - np.hypot(*place)) > 0.5  # m, that the first order leaves out
    assert (np.diagonal(S) > first).all()


def test_clone_and_replacement_keep_correlations_right():
    x, P = np.random.default_rng(5).standard_normal(9), spread(6, 9)
    A = np.eye(9)
    A[6:9] = A[1:4]
    y, expected = A @ x, A @ P @ A.T
    kinematics.clone(x, P, 6, 1)
    np.testing.assert_allclose(x, y)
    np.testing.assert_allclose(P, expected)
    kinematics.replace(x, P, 2, np.ones(3), 7.0 * np.eye(3))
    assert (P[2:5, 2:5] == 7.0 * np.eye(3)).all()
    assert not P[2:5, [0, 1, 5, 6, 7, 8]].any()
    assert (P == P.T).all()


def zero_noise(scene, bearing=False):
    """A run in which nothing is noisy: the truth is the command, the leader's estimate the truth."""
    first_l, motion_l, first_f, motion_f = truths.commands(scene, 400)
    leader, follower = truths.integrate(first_l, motion_l), truths.integrate(first_f, motion_f)
    run = simulate(Conditions(scene=scene, noise="paper", duration=400.0), 0, 0)
    conditions = Conditions(
        scene=scene, noise="paper", duration=400.0, bearing=math.radians(2.0) if bearing else math.nan
    )
    events = []
    P = START.copy()
    for l in range(40):
        k = 10 * l
        if l:
            P = truths._grown(P, leader[k - 10 : k + 1], run.noise.leader)
        events.append(truths._pulse(conditions, l, 10.0 * l, 10.0 * l, leader[k], follower[k], 0.0, 0.0))
        events.append(Packet(l, 10.0 * l, 10.0 * l, leader[k], P, float(motion_l[k, 0]), float(motion_l[k, 1])))
    return truths.Run(
        conditions=conditions,
        leader=leader,
        follower=follower,
        leader_own=leader,
        odometry=motion_f,
        start=Gaussian(mean=follower[0], covariance=START),
        events=tuple(events),
        prompt=tuple(events),
    )


@pytest.mark.parametrize(("scene", "bearing"), [("weave", False), ("curve", True)])
def test_bound_is_the_covariance_of_the_filter_linearised_at_the_truth(scene, bearing):
    """Where nothing is noisy a filter is linearised at the truth: both are then one Gaussian problem, solved twice."""
    run = zero_noise(scene, bearing)
    method = cloning(run, bends=False)
    for k, (speed, yaw_rate) in enumerate(run.odometry):
        for event in run.events:
            if isinstance(event, Pulse) and event.emitted == k * STEP:
                method.hear(event)
            elif isinstance(event, Packet) and event.stamp == k * STEP:
                method.receive(event)
        method.advance((k + 1) * STEP, speed, yaw_rate)
    sightings = [
        Sighting(e.emitted, e.detected, e.range_variance, e.bearing_variance)
        for e in run.events
        if isinstance(e, Pulse)
    ]
    noises, starts = (run.noise.leader, run.noise.follower), (START, START)
    bound = position_bounds(run.leader[None], run.follower[None], STEP, noises, starts, [sightings], [400.0])[0]
    np.testing.assert_allclose(method.belief.mean, run.follower[-1], atol=1e-6)
    np.testing.assert_allclose(method.covariance[:2, :2], bound, rtol=1e-6)


def test_bound_without_pulses_is_that_of_dead_reckoning():
    run = zero_noise("weave")
    method = DeadReckoning(run.start, run.noise.follower)
    for k, (speed, yaw_rate) in enumerate(run.odometry[:250]):
        method.advance((k + 1) * STEP, speed, yaw_rate)
    noises = (run.noise.leader, run.noise.follower)
    late = [[Sighting(0.0, 399.0, 1.0)]]
    bound = position_bounds(run.leader[None], run.follower[None], STEP, noises, (START, START), late, [250.0])[0]
    np.testing.assert_allclose(method.covariance[:2, :2], bound, rtol=1e-9)


def test_sampled_truths_that_differ_lower_the_bound():
    runs = [simulate(Conditions(noise="paper", duration=300.0), 5, k) for k in range(3)]
    noises = (runs[0].noise.leader, runs[0].noise.follower)
    seen_ = [[Sighting(e.emitted, e.detected, 225.0) for e in r.events if isinstance(e, Pulse)] for r in runs]

    def rms(which):
        bound = position_bounds(
            np.array([runs[k].leader for k in which]),
            np.array([runs[k].follower for k in which]),
            STEP,
            noises,
            (START, START),
            [seen_[k] for k in which],
            [300.0],
        )
        return math.sqrt(np.trace(bound[0]))

    assert rms([0, 1, 2]) < np.mean([rms([k]) for k in range(3)])


def test_delay_costs_the_cloning_filter_nothing_but_the_last_pulses():
    """A follower hears late but knows where it was: after the last packet it is where prompt hearing had put it."""
    for make in (cloning, real_time):
        run = zero_noise("weave")
        late = [
            e._replace(received=e.stamp + 25.0) if isinstance(e, Packet) else e._replace(detected=e.emitted + 1e-6)
            for e in run.events
        ]
        late.sort(key=lambda e: (e.received, 0) if isinstance(e, Packet) else (e.detected, 1))
        late = [e for e in late if (e.received if isinstance(e, Packet) else e.detected) <= 400.0]
        heard = {e.number for e in late if isinstance(e, Packet)}
        prompt = [e for e in run.events if e.number in heard or make is real_time]
        tracks = []
        for events in (late, prompt):
            method = make(run)
            follow(method, truths.replace(run, events=tuple(events)))
            tracks.append(method.covariance[:2, :2])
        assert np.trace(tracks[0]) == pytest.approx(np.trace(tracks[1]), rel=0.02)  # linearised elsewhere


def test_order_of_packets_does_not_matter_to_the_real_time_filter():
    run = simulate(Conditions(delay=45.0, duration=400.0), 4, 1)
    swapped = list(run.events)
    packets = [k for k, e in enumerate(swapped) if isinstance(e, Packet)]
    for one, other in zip(packets[6::2], packets[7::2], strict=False):
        swapped[one], swapped[other] = (
            swapped[other]._replace(received=swapped[one].received),
            swapped[one]._replace(received=swapped[other].received),
        )
    ends = []
    for events in (run.events, tuple(swapped)):
        method = real_time(run)
        follow(method, truths.replace(run, events=events))
        ends.append(method.belief)
    assert np.hypot(*(ends[0].mean - ends[1].mean)[:2]) < 0.2  # m, of a deviation of 10: only where it is linearised
    np.testing.assert_allclose(ends[0].covariance[:2, :2], ends[1].covariance[:2, :2], rtol=0.02)


def test_pulse_whose_packet_is_lost_is_used_with_the_leader_interpolated():
    run = zero_noise("lweave")
    packets = {e.number: e for e in run.events if isinstance(e, Packet)}
    for number in (4, 5, 6, 7):
        place = interpolated(packets[3], packets[8], 10.0 * number)
        assert np.hypot(*(place - packets[number].pose)[:2]) < 0.6  # m, over 50 s of a leader that weaves

    def few(number):
        return number % 3 == 0

    events = tuple(e for e in run.events if isinstance(e, Pulse) or few(e.number))
    ends = {}
    for name, chosen in (("all", run.events), ("lost", events)):
        method = cloning(run)
        follow(method, truths.replace(run, events=chosen))
        ends[name] = method
    assert len(ends["lost"].fit) == len(ends["all"].fit)
    np.testing.assert_allclose(ends["lost"].mean[:2], run.follower[-1, :2], atol=4.0)  # m, of 70
    traces = [np.trace(ends[name].covariance[:2, :2]) for name in ("all", "lost")]
    assert traces[0] == pytest.approx(traces[1], rel=0.05)  # 4 m^2 of 226 more, and where it is linearised


def test_leader_that_takes_a_fix_begins_its_error_anew():
    method = CloningFilter(Gaussian(mean=FIRST, covariance=START), NOISE)
    method.receive(packet(0, [0.0, 0.0, 0.0], 100.0 * START))
    method.receive(packet(1, [30.0, 0.0, 0.0], START))
    np.testing.assert_allclose(method.covariance[3:6, 3:6], START)
    assert not method.covariance[3:6, :3].any()


def test_iiru_freezes_the_leader_and_waits_for_its_pulse():
    run = zero_noise("straight")
    method = iiru(run)
    method.receive(packet(0, run.leader[0]))
    times = []
    for second in range(1, 60):
        method.advance(float(second), 3.0, 0.0)
        if second == 12:
            method.hear(Pulse(1, 10.0, 12.0, 500.0, 226.0))
        times.append(method._stamp)
    assert times[9:11] == [10.0, 10.0]  # frozen at the emission of pulse 1
    assert times[11] == 12.0  # switched to now when it is heard
    assert times[20:25] == [20.0] * 4 + [20.0]  # frozen at that of pulse 2
    assert times[26] == 27.0  # lost: it goes on 6 s later
    assert times[-1] <= 60.0


def test_iiru_takes_of_an_old_packet_the_statistics_alone():
    run = zero_noise("straight")
    method = iiru(run)
    method.receive(packet(1, run.leader[10]))
    before = method.mean.copy()
    method.receive(packet(0, run.leader[0] + 100.0, yaw_rate=0.2))
    assert (method.mean == before).all()
    assert method._yaw_rate.count == 2


def test_iiru_with_its_literal_innovation_covariance():
    """Eq. 16 leaves out the cross terms: without correlation it is the Kalman filter's, with it it is not."""
    run = zero_noise("weave")
    pulse = Pulse(0, 0.0, 0.0, 310.0, 226.0)
    for correlated in (False, True):
        ends = []
        for full in (False, True):
            method = iiru(run, full_gain=full)
            method.receive(packet(0, run.leader[0], 40.0 * START))
            if correlated:
                method.covariance[0, 3] = method.covariance[3, 0] = 5.0
            method.hear(pulse)
            ends.append(method.mean[:2])
        assert np.allclose(*ends, rtol=0.0, atol=1e-9) != correlated


def test_reduced_filter_leaves_the_leader_alone():
    run = zero_noise("weave")
    method = iiru(run, coupled=False)
    method.receive(packet(0, run.leader[0]))
    method.hear(Pulse(0, 0.0, 0.0, 330.0, 226.0))
    assert (method.mean[3:6] == run.leader[0]).all()
    assert not method.covariance[:3, 3:].any()
    assert method.covariance[0, 0] < 1.0


def test_varying_speed_follows_a_leader_that_speeds_up():
    run = simulate(Conditions(scene="accelerating", noise="fine", delay=30.0), 3, 0)
    errors = {}
    for varies in (False, True):
        method = iiru(run, varying_speed=varies)
        errors[varies] = np.hypot(*follow(method, run).leader[20:].T).mean()
    assert errors[True] < errors[False]


@pytest.mark.parametrize("key", ["sc", "rt", "choosing"])
def test_consistent_at_fine_noise(key):
    """NEES of the position at the end over 40 runs, and no more error than with no delay."""
    ours, prompt = [], []
    for number in range(40):
        run = simulate(Conditions(duration=600.0), 11, number)
        ours.append(follow(METHODS[key].make(run), run))
        prompt.append(follow(METHODS["oracle"].make(run), undelayed(run)))
    low, high = interval(2, 40, 0.99)
    assert low < 2.0 * np.mean([t.nees[-1] for t in ours]) < high
    rms = [math.sqrt(np.mean([np.sum(t.errors[-1] ** 2) for t in each])) for each in (ours, prompt)]
    assert rms[0] / rms[1] < 1.15  # the packets of the last 15 s are still to come


def test_ignoring_the_delay_is_inconsistent():
    runs = [simulate(Conditions(duration=600.0), 11, number) for number in range(10)]
    squares = [follow(METHODS["ekf"].make(run), run).nees[-1] for run in runs]
    assert 2.0 * np.mean(squares) > interval(2, 10, 0.999)[1]


def test_bearings_show_what_ranges_do_not_when_in_line():
    conditions = Conditions(scene="inline", duration=600.0)
    ranges, bearings = (
        [np.hypot(*follow(cloning(run), run).errors[-1]) for run in (simulate(c, 2, number) for number in range(6))]
        for c in (conditions, truths.replace(conditions, ranged=False, bearing=math.radians(1.0)))
    )
    assert np.mean(bearings) < 0.5 * np.mean(ranges)


def test_choice_goes_to_the_member_that_foretells_the_pulses():
    start = Gaussian(mean=FIRST, covariance=START)
    both = ChoosingFilter(CloningFilter(start, NOISE), RealTimeFilter(start, NOISE, LEADER_NOISE))
    assert both.weight == pytest.approx(1.0 / (1.0 + math.exp(1.0)))
    both.members[0].fit[0], both.members[1].fit[0] = -1.0, -101.0
    both._judge()  # one pulse, which says no more than a ratio of 2
    assert both.weight == pytest.approx(1.0 / (1.0 + math.exp(1.0 - 0.3 * 2.0)))
    for number in range(1, 30):
        both.members[0].fit[number], both.members[1].fit[number] = -1.0, -2.5
        both._judge()
    evidence = 2.0 * 0.99**29 + 1.5 * (1.0 - 0.99**29) / (1.0 - 0.99)
    assert both.weight == pytest.approx(1.0 / (1.0 + math.exp(1.0 - 0.3 * evidence)))
    both.members[0].mean[:2] += 10.0
    found = both.belief
    w, apart = both.weight, both.members[0].mean[:3] - both.members[1].mean[:3]
    np.testing.assert_allclose(found.mean, both.members[1].mean[:3] + w * apart)
    mixed = w * both.members[0].covariance[:3, :3] + (1.0 - w) * both.members[1].covariance[:3, :3]
    np.testing.assert_allclose(found.covariance, mixed + w * (1.0 - w) * np.outer(apart, apart), atol=1e-12)


@pytest.mark.parametrize(
    ("scene", "rank", "heading"), [("straight", 3, True), ("weave", 4, True), ("inline", 1, False), ("curve", 3, True)]
)
def test_rank_of_ranges(scene, rank, heading):
    """In line a range shows but the distance, abeam no shift along; a bearing that turns, all."""
    first_l, motion_l, first_f, motion_f = truths.commands(scene, 1000)
    leader, follower = truths.integrate(first_l, motion_l), truths.integrate(first_f, motion_f)
    found = observability(leader, follower, STEP, np.arange(0.0, 1000.0, 10.0), 226.0)
    assert (found.rank, found.heading_observable) == (rank, heading)


def test_delayed_filter_goes_back_to_where_the_range_was_taken():
    """A heading error turns all that was gone since; against a correction of the pose then, carried on by odometry."""
    first = np.array([100.0, -40.0, 0.6])
    P0 = np.diag([25.0, 16.0, 0.04])
    method = DelayedFilter(Gaussian(mean=first, covariance=P0), Noise(0.0, 0.0))
    method.hear(Pulse(0, 0.0, 0.0, 210.0, 9.0))
    for second in range(1, 31):
        method.advance(float(second), 3.0, 0.02)
    method.receive(packet(0, [300.0, 30.0, 0.2], late=30.0))
    prompt = CloningFilter(Gaussian(mean=first, covariance=P0), Noise(0.0, 0.0), bends=False)
    prompt.hear(Pulse(0, 0.0, 0.0, 210.0, 9.0))
    for second in range(1, 31):
        prompt.advance(float(second), 3.0, 0.02)
    prompt.receive(packet(0, [300.0, 30.0, 0.2], late=30.0))
    np.testing.assert_allclose(method.mean, prompt.mean[:3], atol=1e-9)
    np.testing.assert_allclose(method.covariance, prompt.covariance[:3, :3], atol=1e-9)


def test_packet_predicted_to_the_frozen_leader():
    """Eqs 20 and 21: in one Euler step, whose held inputs are wrong all the way."""
    run = zero_noise("straight")
    method = iiru(run)
    first = packet(0, run.leader[0], yaw_rate=0.01)
    method.advance(10.0, 3.0, 0.0)
    method.receive(first)  # the leader's part begins where it is frozen, at 10 s
    h, q = 10.0, run.noise.leader
    F = np.array(
        [[1.0, 0.0, -h * 3.0 * math.sin(first.pose[2])], [0.0, 1.0, h * 3.0 * math.cos(first.pose[2])], [0, 0, 1]]
    )
    G = np.array([[math.cos(first.pose[2]), 0.0], [math.sin(first.pose[2]), 0.0], [0.0, 1.0]])
    expected = F @ START @ F.T + h**2 * G @ np.diag(q) @ G.T
    np.testing.assert_allclose(method.covariance[3:6, 3:6], expected)
    np.testing.assert_allclose(method.mean[5], first.pose[2] + 0.1)


@pytest.mark.parametrize("kind", [CloningFilter, RealTimeFilter])
def test_error_of_the_leader_moves_with_it(kind):
    """By Phi = [[1, 0, -east], [0, 1, north], [0, 0, 1]] of what it broadcast, and as uncertain as it says itself."""
    start = Gaussian(mean=FIRST, covariance=START)
    method = kind(start, NOISE) if kind is CloningFilter else kind(start, NOISE, LEADER_NOISE)
    heading = 0.4
    north, east = 30.0 * math.cos(heading), 30.0 * math.sin(heading)
    method.receive(packet(0, [5.0, -3.0, heading]))
    method.mean[3:6] = [1.0, 2.0, 0.1]
    Phi = np.array([[1.0, 0.0, -east], [0.0, 1.0, north], [0.0, 0.0, 1.0]])
    grown = Phi @ START @ Phi.T + kinematics.odometry_covariance(heading, 3.0, 10.0, *LEADER_NOISE)
    method.receive(packet(1, [5.0 + north, -3.0 + east, heading], grown))
    np.testing.assert_allclose(method.mean[3:6], Phi @ [1.0, 2.0, 0.1], atol=1e-6)
    np.testing.assert_allclose(method.covariance[3:6, 3:6], grown, rtol=1e-9)
