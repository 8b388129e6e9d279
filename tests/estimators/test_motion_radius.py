"""Filters of ranges to a leader: the paper's algebra, the bank against core's models, late packets, geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from auvsim.reproduce.paper2.filters import METHODS, TIMES, follow, prior
from auvsim.reproduce.paper2.runs import CYCLE, NOISES, Conditions, simulate
from estimators.core import ekf
from estimators.core.errors import ParameterError
from estimators.core.history import History, Node
from estimators.core.models.motion import dead_reckoning, with_current, with_error, with_input_error
from estimators.core.models.odometry import SPACE, Displacement, OdometryNoise, move, show_bearing, show_range
from estimators.core.models.process import MotionProcess
from estimators.core.models.sensors import bearing_to, range_to
from estimators.core.types import Gaussian, Measurement
from estimators.motion_radius import batch, paper
from estimators.motion_radius.bank import SPLIT, BankFilter, pruned, split, spread_over_currents
from estimators.motion_radius.geometry import second_solution
from estimators.motion_radius.paper import Packet, PaperFilter
from estimators.motion_radius.ranges import SHARED, flattened, leader_range
from estimators.motion_radius.reckoning import DeadReckoning

X = np.array([130.0, -40.0, 0.3, -0.7])
DELTA = Displacement(8.0, 11.0, -9.0)
LEADER, BEFORE = np.array([60.0, 85.0]), np.array([48.0, 90.0])
NOISE = OdometryNoise(forward=0.01, starboard=0.002, heading=3e-4)
DEVIATIONS = {
    "north": 9.0, "east": 7.0, "current_north": 0.4, "current_east": 0.6, "range_offset": 2.0, "range_drift": 0.01,
    "range_scale": 0.02, "speed_scale": 0.04, "compass_bias": 0.06,
}  # fmt: skip


def derivative(f, at, step=1e-4):
    """Central differences; exact but for rounding where f is at most quadratic."""
    columns = []
    for i in range(at.size):
        d = np.zeros(at.size)
        d[i] = step
        columns.append((f(at + d) - f(at - d)) / (2.0 * step))
    return np.array(columns).T


def test_the_papers_matrices_are_its_derivatives():
    h = DELTA.duration
    delta = np.array([DELTA.north, DELTA.east])

    def moved(x, w):  # x', with noise of position, displacement and current before it
        p, u = x[:2] + w[:2], x[2:] + w[4:]
        return np.concatenate((p + delta + w[2:4] + h * u, u))

    def seen(x, v):  # squared ranges, with the ten noise sources of section 3
        p, u = x[:2] + v[:2], x[2:] + v[8:]
        a = p - (BEFORE + v[2:4])
        b = p + delta + v[6:8] + h * u - (LEADER + v[4:6])
        return np.array([a @ a, b @ b])

    F, W = paper.transition(h)
    a, b = X[:2] - BEFORE, X[:2] + delta + h * X[2:] - LEADER
    H, V = paper.derivatives(a, b, h)
    assert derivative(lambda x: moved(x, np.zeros(6)), X) == pytest.approx(F, abs=1e-8)
    assert derivative(lambda w: moved(X, w), np.zeros(6)) == pytest.approx(W, abs=1e-8)
    assert derivative(lambda x: seen(x, np.zeros(10)), X) == pytest.approx(H, rel=1e-6, abs=1e-5)
    # The print has the sources of current once in each range; V is zero there in the first row.
    first = derivative(lambda v: seen(X, v), np.zeros(10))
    assert first == pytest.approx(V, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("reading", ["A", "C"])
def test_correction_is_eqs_15_to_18(reading):
    belief = Gaussian(mean=X, covariance=np.diag([90.0, 70.0, 0.4, 0.3]) + 0.05)
    before, now = Packet(150.0, BEFORE), Packet(170.0, LEADER)
    h = DELTA.duration
    F, W = paper.transition(h)
    P = F @ belief.covariance @ F.T + W @ paper.Q @ W.T
    following = np.array([X[0] + DELTA.north + h * X[2], X[1] + DELTA.east + h * X[3], X[2], X[3]])

    def seen_before(x):
        a = x[:2] - BEFORE
        b = x[:2] + (DELTA.north, DELTA.east) + h * x[2:] - LEADER
        return np.array([a @ a, b @ b])

    def seen_after(x):
        a = x[:2] - (DELTA.north, DELTA.east) - h * x[2:] - BEFORE
        b = x[:2] - LEADER
        return np.array([a @ a, b @ b])

    H = derivative(seen_before, X) if reading == "A" else derivative(seen_after, following)
    _, V = paper.derivatives(X[:2] - BEFORE, following[:2] - LEADER, h)
    S = H @ P @ H.T + V @ paper.R @ V.T
    K = P @ H.T @ np.linalg.inv(S)
    z = np.array([before.distance**2, now.distance**2])
    found, nis = paper.corrected(belief, DELTA, before, now, reading)
    # 1e-5: central differences of squares of hundreds of metres.
    assert found.mean == pytest.approx(following + K @ (z - seen_before(X)), rel=1e-5)
    assert found.covariance == pytest.approx((np.eye(4) - K @ H) @ P, rel=1e-4, abs=1e-4)
    assert nis == pytest.approx((z - seen_before(X)) @ np.linalg.solve(S, z - seen_before(X)), rel=1e-5)


def errors(run, followed):
    return np.hypot(*(followed.means - run.truth[CYCLE::CYCLE])[:, :2].T)


def test_reading_c_without_noise_converges_and_reading_a_peaks_higher():
    run = simulate(Conditions(noise="clean"), 3)
    of_a, of_c = (errors(run, follow(run, METHODS[key])) for key in ("paper", "paper_c"))
    assert of_c.max() < 20.0
    assert of_c[-1] < 0.1
    assert of_a.max() > 2.0 * of_c.max()  # specification, X2: 131 beside 65 m with noise


def test_one_term_too_many_biases_the_current_by_an_eighth_of_the_speed():
    run = simulate(Conditions(), 4)
    off = []
    for key in ("paper", "paper_nine"):
        error = (follow(run, METHODS[key]).means - run.truth[CYCLE::CYCLE])[TIMES > 1500.0, 2:]
        off.append(np.hypot(*error.mean(axis=0)))
    assert off[0] < 0.05
    assert 0.17 < off[1] < 0.3  # 2 m/s / 8 along the way, less by the weave's cosine


def test_over_lost_packets_the_next_range_is_paired_with_the_last_that_came():
    run = simulate(Conditions(), 5)
    few = {second: run.packets[second] for second in (0, 8, 16, 48, 56)}
    filter_ = PaperFilter()
    state = filter_.start([Node(0.0, (), [few[0]], True)], 0)
    for second in range(1, 57):
        state = filter_.predict(state, tuple(run.inputs[second - 1]), 1.0)
        if second == 48:
            whole = Displacement()
            for u in run.inputs[16:48]:
                whole = whole.extended(u[0], u[1], u[2], 1.0, OdometryNoise())
            before, now = (Packet(float(few[k].value[0]), np.array(few[k].parameters[:2])) for k in (16, 48))
            expected, _ = paper.corrected(state.corrected, whole, before, now, "A")
            state = filter_.correct(state, 48.0, [few[48]])
            assert state.belief.mean == pytest.approx(expected.mean, rel=1e-12)
            assert state.belief.covariance == pytest.approx(expected.covariance, rel=1e-9)
        elif second in few:
            state = filter_.correct(state, float(second), [few[second]])


def core_process():
    motion = with_current(dead_reckoning("given"))
    for name, unit in (("range_offset", "m"), ("range_drift", "m/s"), ("range_scale", "1")):
        motion = with_error(motion, name, unit)
    motion = with_input_error(with_input_error(motion, "forward", "scale"), "heading", "bias")
    return motion


def test_model_is_that_of_cores_motions_and_sensors():
    """Scale on the speed ahead alone and no drift of the offset, which core's motions have no word for."""
    motion = core_process()
    process = MotionProcess(motion, {}, input_noise={"forward": NOISE.forward, "starboard": NOISE.starboard})
    values = {name: 0.3 * deviation for name, deviation in DEVIATIONS.items()} | {"range_drift": 0.0}
    start = SPACE.belief(values, DEVIATIONS | {"range_drift": 0.0})
    names = (*SPACE.names[:7], "forward_scale", "heading_bias")
    assert motion.space.names == names
    m = leader_range(140.0, (60.0, 85.0, 12.0), deviation=1.5, stamp=8.0, depth=3.0)
    quiet = OdometryNoise(forward=NOISE.forward, starboard=NOISE.starboard)
    bank = BankFilter(start, quiet, side=1)
    state = bank.start([Node(0.0, (), [], True)], 0)
    belief, u = start, (1.4, 0.0, 0.8)
    for _ in range(8):
        state = bank.predict(state, u, 1.0)
        belief = ekf.predict(belief, process, u, 1.0)
    predicted = state.belief
    assert predicted.mean == pytest.approx(belief.mean, abs=1e-9)
    # Core turns the noise by the compass bias and scales it, the bank takes it as measured: 2 % of 0.3 m.
    assert predicted.covariance == pytest.approx(belief.covariance, abs=0.01)
    sensor = range_to(motion, depth=3.0, bias="range_offset", scale="range_scale")
    same = Measurement(
        kind="range", value=m.value, covariance=m.covariance, stamp=8.0, received=8.0, parameters=m.parameters[:3]
    )
    expected, innovation = ekf.correct(predicted, same, sensor)
    found = bank.correct(state, 8.0, [m])
    assert found.belief.mean == pytest.approx(expected.mean, abs=1e-9)
    assert found.belief.covariance == pytest.approx(expected.covariance, abs=1e-9)
    assert found.verdicts[0][2] == pytest.approx(innovation.nis)


def test_drift_of_the_offset_and_the_derivative_by_all_states():
    x = SPACE.vector({name: 0.5 * deviation for name, deviation in DEVIATIONS.items()})
    d = (8.0, 11.0, -9.0)

    def moved(x):
        following, F = np.empty(9), np.eye(9)
        move(x, d, following, F)
        return following

    F, following = np.eye(9), np.empty(9)
    move(x, d, following, F)
    assert following[4] == x[4] + 8.0 * x[5]
    assert derivative(moved, x, 1e-6) == pytest.approx(F, abs=1e-7)
    H = np.empty((1, 9))
    show_range(x, 40.0, -70.0, 15.0, H)
    assert derivative(lambda x: np.array([show_range(x, 40.0, -70.0, 15.0, np.empty((1, 9)))]), x, 1e-5) == (
        pytest.approx(H, abs=1e-8)
    )
    show_bearing(x, 40.0, -70.0, H)
    assert derivative(lambda x: np.array([show_bearing(x, 40.0, -70.0, np.empty((1, 9)))]), x, 1e-5) == (
        pytest.approx(H, abs=1e-8)
    )
    motion = with_current(dead_reckoning("given"))
    bearing = bearing_to(motion, (40.0, -70.0, 0.0), relative=False)
    m = Measurement(kind="bearing", value=np.zeros(1), covariance=np.eye(1), stamp=0.0, received=0.0)
    assert show_bearing(x * np.r_[np.ones(8), 0.0], 40.0, -70.0, H) == pytest.approx(bearing.evaluate(x[:4], m)[0])


def test_noise_of_a_displacement_is_that_of_its_samples():
    noise = NOISE._replace(heading=0.008)  # so that it counts as much as the speed's
    rng = np.random.default_rng(8)
    count, headings = 20000, 0.4 + 0.9 * np.sin(np.arange(8.0))
    whole = Displacement()
    for heading in headings:
        whole = whole.extended(1.5, 0.2, heading, 1.0, noise)
    v = 1.5 + math.sqrt(NOISE.forward) * rng.standard_normal((count, 8))
    w = 0.2 + math.sqrt(NOISE.starboard) * rng.standard_normal((count, 8))
    psi = headings + math.sqrt(noise.heading) * rng.standard_normal((count, 8))
    sums = np.stack(((v * np.cos(psi) - w * np.sin(psi)).sum(1), (v * np.sin(psi) + w * np.cos(psi)).sum(1)), axis=1)
    expected = np.cov(sums.T)
    # The standard deviation of a sample covariance is 1 % of the variances at 20 000 samples.
    scale = expected.diagonal().max()
    assert np.array([whole.north_north, whole.north_east, whole.east_east]) == pytest.approx(
        [expected[0, 0], expected[0, 1], expected[1, 1]], abs=0.04 * scale
    )


def test_bank_covers_the_currents_of_its_start():
    start = SPACE.belief({"current_north": 0.2}, DEVIATIONS)
    means, covariances, weights = spread_over_currents(start, 7)
    spread = means - weights @ means
    total = np.einsum("m,mij->ij", weights, covariances) + np.einsum("m,mi,mj->ij", weights, spread, spread)
    assert weights @ means == pytest.approx(start.mean)
    assert np.diagonal(total) == pytest.approx(np.diagonal(start.covariance), rel=1e-3)  # BREADTH has four digits


def test_pruning_merges_equal_filters_and_keeps_the_mirror():
    P = np.array([np.eye(9)] * 4)
    means = np.zeros((4, 9))
    means[1, 0], means[2, 0], means[3, 1] = 0.1, 300.0, 40.0
    weights = np.array([0.5, 0.25, 0.25 - 1e-8, 1e-8])
    kept, _, probabilities = pruned(means, P, weights)
    assert kept[:, 0].tolist() == [0.0, 300.0]
    assert probabilities == pytest.approx([0.75, 0.25], abs=1e-7)
    distance, probability = second_solution(kept, P[:2], probabilities)
    assert (distance, probability) == (pytest.approx(300.0), pytest.approx(0.25, abs=1e-7))


def bank_history(run, side=3):
    return History(
        BankFilter(prior(run.noise, {}), run.noise.odometry, side=side), step=1.0, keep=60.0,
        verdicts=lambda state: state.verdicts,
    )  # fmt: skip


def test_late_and_shuffled_packets_end_where_prompt_ones_do():
    run = simulate(Conditions(), 6)
    rng = np.random.default_rng(0)
    delay = {second: int(rng.integers(1, 40)) for second in run.packets}
    results = []
    for late in (False, True):
        history = bank_history(run)
        for second in range(400):
            history.append(float(second), tuple(run.inputs[second - 1]) if second else ())
            for sent, packet in run.packets.items():
                if second == (sent + delay[sent] if late else sent) and sent < 350:
                    assert history.insert(packet)
            history.replay()
        results.append(history.state)
    prompt, late = results
    assert prompt is not None
    assert np.array_equal(prompt.belief.mean, late.belief.mean)
    assert np.array_equal(prompt.belief.covariance, late.belief.covariance)
    assert prompt.accepted == 44


def test_bad_packets_are_refused_by_name():
    run = simulate(Conditions(), 7)
    history = bank_history(run)
    for second in range(20):
        history.append(float(second), tuple(run.inputs[second - 1]) if second else ())
    good = run.packets[8]
    assert history.insert(good)
    assert not history.insert(good)
    assert not history.insert(run.packets[24])
    assert not history.insert(leader_range(math.nan, (0.0, 0.0, 10.0), deviation=1.0, stamp=9.0))
    history.replay()
    assert {k: v for k, v in history.refused.items() if v} == {"duplicate": 1, "future": 1, "not_finite": 1}
    assert history.insert(Measurement(kind="sonar", value=np.ones(1), covariance=np.eye(1), stamp=9.0, received=9.0))
    history.replay()
    assert [(o.kind, o.reason) for o in history.outcomes] == [("sonar", "no_model")]


def test_a_wrong_range_is_refused_by_the_gate_and_by_nothing_else():
    run = simulate(Conditions(), 8)
    start = prior(run.noise, {})
    wrong = leader_range(float(run.packets[16].value[0]) + 400.0, (0.0, 0.0, 10.0), deviation=1.0, stamp=16.0)
    for gate, reason in ((0.9999, "outlier"), (None, "")):
        bank = BankFilter(start, run.noise.odometry, gate=gate)
        state = bank.start([Node(0.0, (), [run.packets[0]], True)], 0)
        for second in range(16):
            state = bank.predict(state, tuple(run.inputs[second]), 1.0)
            if second == 7:
                state = bank.correct(state, 8.0, [run.packets[8]])
        assert bank.correct(state, 16.0, [wrong]).verdicts[-1][1] == reason


def test_an_hour_of_silence_neither_crashes_nor_lies():
    run = simulate(Conditions(), 9)
    followed = follow(run, METHODS["bank"])
    bank, state = BankFilter(prior(run.noise, {}), run.noise.odometry), followed.state
    place = run.truth[-1, :2].copy()
    rng = np.random.default_rng(1)
    for _ in range(3600):
        place += 2.0 * np.array([math.cos(0.5), math.sin(0.5)]) + run.truth[-1, 2:]
        measured = (2.0 + 0.05 * rng.standard_normal(), 0.0, 0.5 + math.radians(0.5) * rng.standard_normal())
        state = bank.predict(state, measured, 1.0)
    belief = state.belief
    error = belief.mean[:2] - place
    assert error @ np.linalg.solve(belief.covariance[:2, :2], error) < 18.4  # 99.99 % of two degrees of freedom
    assert 1.0 < math.sqrt(np.trace(belief.covariance[:2, :2])) < 60.0


def test_flattened_variance_is_the_specifications_and_a_steep_range_is_refused():
    r, dz = 50.0, 30.0
    distance, variance = flattened(r, dz, 1.2, 0.7) or (0.0, 0.0)
    assert distance == pytest.approx(40.0)
    assert variance == pytest.approx((50.0 / 40.0) ** 2 * 1.2**2 + (30.0 / 40.0) ** 2 * 0.7**2)
    step = 1e-5
    by_r = (math.hypot(r + step, 0.0) ** 2 - dz**2) ** 0.5 - 40.0
    assert (by_r / step * 1.2) ** 2 == pytest.approx((50.0 / 40.0 * 1.2) ** 2, rel=1e-4)
    assert flattened(29.9, 30.0, 1.0) is None
    with pytest.raises(ParameterError, match="below 0"):
        flattened(50.0, 30.0, -1.0)
    state = PaperFilter().start([Node(0.0, (), [], True)], 0)
    steep = leader_range(9.0, (0.0, 0.0, 30.0), deviation=1.0, stamp=0.0, depth=20.0)
    assert PaperFilter().correct(state, 0.0, [steep]).verdicts[0][1] == "too_steep"


def test_a_steep_slant_range_says_as_little_in_the_plan_view_as_the_flattened_one():
    """The bank's slant range of three dimensions and the flattened range give one position the same information."""
    start = SPACE.belief({"north": 40.0}, {"north": 20.0})
    for height, deviation, of_depth in ((30.0, 1.2, 0.7), (400.0, 1.2, 0.7)):
        r = math.hypot(40.0, height)
        m = leader_range(r, (0.0, 0.0, height), depth=0.0, deviation=deviation, depth_deviation=of_depth, stamp=0.0)
        bank = BankFilter(start, NOISE, side=1)
        P = bank.start([Node(0.0, (), [m], True)], 0).belief.covariance[0, 0]
        _, variance = flattened(r, height, deviation, of_depth) or (0.0, 0.0)
        gained = 1.0 / P - 1.0 / 400.0
        assert gained == pytest.approx(1.0 / variance, rel=1e-9)


@pytest.mark.parametrize(
    ("tracks", "rank"), [("parallel", 2), ("oblique", 3), ("weave", 4), ("leaderweave", 4), ("far", 4)]
)
@pytest.mark.parametrize("noise", ["nominal", "coarse"])
def test_rank_of_the_geometry_is_flagged(tracks, rank, noise):
    run = simulate(Conditions(tracks=tracks, noise=noise), 10)
    state = follow(run, METHODS["ekf"]).state
    assert state.geometry.rank == rank
    assert any(f"rank {rank} of 4" in text for text in state.warnings) == (rank < 4)


def test_smoothing_is_the_most_probable_trajectory():
    """Against dense least squares of start, errors and the noise of each displacement, an implementation apart."""
    rng = np.random.default_rng(2)
    count, dt = 12, 20.0
    start = SPACE.belief({"north": 5.0, "east": -3.0}, DEVIATIONS | {"range_drift": 0.0})
    inputs = np.stack((1.2 + 0.1 * rng.standard_normal(count), np.zeros(count), np.linspace(0.0, 4.0, count)), axis=1)
    leader = [(80.0 + 3.0 * k, 60.0 - 8.0 * k, 4.0 + k) for k in range(count)]
    nodes = [Node(dt * k, (*inputs[min(k, count - 1)],), [], True) for k in range(count + 1)]
    for k in range(count):
        value = 90.0 + 6.0 * math.sin(k) + rng.standard_normal()
        nodes[k + 1].measurements.append(leader_range(value, leader[k], deviation=1.5, stamp=dt * (k + 1), depth=0.0))
    rows = [Displacement().extended(u[0], u[1], u[2], dt, NOISE) for u in inputs]
    roots = [np.linalg.cholesky([[r.north_north, r.north_east], [r.north_east, r.east_east]]) for r in rows]
    free = np.array([name != "range_drift" for name in SPACE.names])
    deviations = SPACE.vector(DEVIATIONS)

    def states(z):
        x = start.mean.copy()
        x[free] += deviations[free] * z[:8]
        places = [x]
        for row, root, w in zip(rows, roots, z[8:].reshape(-1, 2), strict=True):
            x = x.copy()
            c, s, g = math.cos(x[8]), math.sin(x[8]), 1.0 / (1.0 + x[7])
            x[:2] += (g * (c * row.north + s * row.east), g * (c * row.east - s * row.north))
            x[:2] += dt * x[2:4] + root @ w
            places.append(x)
        return np.array(places[1:])

    def residuals(z):
        x = states(z)
        seen = (1.0 + x[:, 6]) * np.sqrt(
            ((x[:, :2] - np.array(leader)[:, :2]) ** 2).sum(1) + np.array(leader)[:, 2] ** 2
        )
        measured = np.array([node.measurements[0].value[0] for node in nodes[1:]])
        return np.concatenate((z, (measured - seen - x[:, 4]) / 1.5))

    best = least_squares(residuals, np.zeros(8 + 2 * count), xtol=1e-14, ftol=1e-14, gtol=1e-12)
    smoothed = batch.solve(nodes, start, NOISE, states(best.x)[-1] + 0.05)
    assert smoothed.means == pytest.approx(states(best.x), abs=2e-3)  # TOLERANCE of a step is 1e-3 m
    information = best.jac.T @ best.jac
    unit = derivative(lambda z: states(z)[4, :2], best.x, 1e-5)
    expected = unit @ np.linalg.inv(information) @ unit.T
    assert smoothed.covariances[4, :2, :2] == pytest.approx(expected, rel=1e-3)


def test_dead_reckoning_drifts_with_the_current_and_says_so():
    belief = Gaussian(mean=np.array([1.0, 2.0, 0.1, 0.0]), covariance=np.diag([1.0, 1.0, 0.25, 0.04]))
    filter_ = DeadReckoning(belief, OdometryNoise(position=0.5))
    state = filter_.start([Node(0.0, (), [], True)], 0)
    for _ in range(4):
        state = filter_.predict(state, (1.5, 0.0, math.pi / 2.0), 2.0)
    found = state.belief
    assert found.mean == pytest.approx([1.8, 14.0, 0.1, 0.0])
    assert np.diagonal(found.covariance) == pytest.approx(
        [1.0 + 64.0 * 0.25 + 4.0, 1.0 + 64.0 * 0.04 + 4.0, 0.25, 0.04]
    )
    refused = filter_.correct(state, 8.0, [leader_range(10.0, (0.0, 0.0, 0.0), deviation=1.0, stamp=8.0)])
    assert refused.verdicts[0][1] == "no_model"


def test_settings_that_cannot_be_are_named():
    with pytest.raises(ParameterError, match="reading 'B'"):
        PaperFilter(reading="B")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="9 states"):
        BankFilter(Gaussian(mean=np.zeros(4), covariance=np.eye(4)), NOISE)


def test_bank_is_consistent_where_a_lone_filter_gets_lost():
    """Coarse noise, 25 seeds that no setting was chosen on: rms 2.8 m is the bound; 95 % of means lie within 20 %."""
    noise, squares, nees = NOISES["coarse"], [], []
    for seed in range(700, 725):
        run = simulate(Conditions(noise="coarse"), seed)
        followed = follow(run, METHODS["bank"])
        late = TIMES > 500.0
        error = (followed.means - run.truth[CYCLE::CYCLE])[late, :2]
        squares.append((error**2).sum(1).mean())
        spread = followed.covariances[late, :2, :2]
        nees.append(0.5 * np.einsum("ki,ki->k", error, np.linalg.solve(spread, error[..., None])[..., 0]).mean())
        assert np.hypot(*error[-1]) < 20.0
    assert noise.range == 3.0
    assert 0.75 * 2.8 < math.sqrt(np.mean(squares)) < 1.3 * 2.8
    assert 0.7 < np.mean(nees) < 1.4


def test_a_range_to_one_that_may_share_its_error_decides_between_no_filters():
    """It corrects each filter as any range does, but leaves their probabilities."""
    start = SPACE.belief({"north": X[0], "east": X[1]}, DEVIATIONS)
    bank = BankFilter(start, NOISE)
    state = bank.predict(bank.start([Node(0.0, (), [], True)], 0), (2.0, 0.0, 0.3), 8.0)
    seen = leader_range(180.0, (*LEADER, 4.0), deviation=1.0, stamp=8.0, depth=2.0)
    plain, shared = (bank.correct(state, 8.0, [m]) for m in (seen, replace(seen, kind=SHARED)))
    assert np.array_equal(plain.means, shared.means)
    assert np.array_equal(plain.covariances, shared.covariances)
    assert np.array_equal(shared.weights, state.weights)
    assert np.abs(plain.weights - state.weights).max() > 0.01
    assert [reason for _, reason, _ in shared.verdicts] == [""]


def test_errors_of_leaders_that_last_are_states():
    """Two far leaders, heard in turn, without odometry noise: generalised least squares with what they say they err."""
    count, dt, memory, deviation = 8, 30.0, 70.0, 0.5
    sides = np.array([[1.0, 0.0], [0.6, 0.8]])
    rng = np.random.default_rng(5)
    order, told = [0, 1, 1, 0, 1, 0, 0, 1], np.linspace(1.0, 2.5, count)
    start = SPACE.belief({}, {"north": 4.0, "east": 6.0, "current_north": 0.1, "current_east": 0.2})
    bank = BankFilter(start, OdometryNoise(), side=1, memory=memory)
    state = bank.start([Node(0.0, (), [], True)], 0)
    times, reach = dt * np.arange(1, count + 1), 1e7
    values = rng.standard_normal(count)
    for k, leader in enumerate(order):
        state = bank.predict(state, (0.0, 0.0, 0.0), dt)
        m = leader_range(
            reach + values[k], (*(-reach * sides[leader]), 0.0), deviation=deviation, leader_deviation=told[k],
            stamp=times[k], source=str(leader),
        )  # fmt: skip
        state = bank.correct(state, times[k], [m])
    S = deviation**2 * np.eye(count)
    for leader in (0, 1):
        of, variance = [k for k in range(count) if order[k] == leader], 0.0
        for a, i in enumerate(of):
            left = math.exp(-(times[i] - times[of[a - 1]]) / memory) if a else 0.0
            variance = left**2 * variance + told[i] ** 2 * (1.0 - left**2)
            for j in of[a:]:
                S[i, j] += variance * math.exp(-(times[j] - times[i]) / memory)
                S[j, i] = S[i, j]
    H = np.hstack((sides[order], sides[order] * times[:, None]))
    prior = np.diag([16.0, 36.0, 0.01, 0.04])
    P = np.linalg.inv(np.linalg.inv(prior) + H.T @ np.linalg.solve(S, H))
    F = np.block([[np.eye(2), times[-1] * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])
    belief = state.belief
    assert belief.covariance[:4, :4] == pytest.approx(F @ P @ F.T, rel=1e-5)
    assert belief.mean[:4] == pytest.approx(F @ P @ H.T @ np.linalg.solve(S, values), rel=1e-4, abs=1e-4)
    assert len(belief.mean) == len(SPACE)
    with pytest.raises(ParameterError, match="memory -1"):
        BankFilter(start, NOISE, memory=-1.0)


def test_a_filter_is_split_where_a_range_bends_over_it():
    """In three with its mean and covariance, along what an error across the range brings with it; others stay."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((9, 9))
    wide = root @ root.T + np.diag([900.0, 1600.0, *np.full(7, 0.1)])
    means = np.array([rng.standard_normal(9), rng.standard_normal(9) + 3.0])
    covariances, weights = np.array([wide, 1e-3 * wide]), np.array([0.7, 0.3])
    x, P, w = split(means, covariances, weights, 30.0, -80.0, 3.0)
    assert len(w) > 3
    assert (w == 0.3).sum() == 1
    assert w.sum() == pytest.approx(1.0)
    mixed = w != 0.3
    shares = w[mixed] / 0.7
    mean = shares @ x[mixed]
    spread = np.einsum("m,mij->ij", shares, P[mixed]) + np.einsum(
        "m,mi,mj->ij", shares, x[mixed] - mean, x[mixed] - mean
    )
    assert mean == pytest.approx(means[0], abs=1e-9)
    assert spread == pytest.approx(wide, rel=1e-9, abs=1e-9)
    for k in np.flatnonzero(w > SPLIT):
        way = x[k, :2] - (30.0, -80.0)
        across = np.array((-way[1], way[0])) / np.hypot(*way)
        assert 0.5 * across @ P[k, :2, :2] @ across / np.hypot(*way) <= 3.0
    same = split(means, covariances, weights, 30.0, -80.0, math.inf)
    assert all(a is b for a, b in zip(same, (means, covariances, weights), strict=True))
