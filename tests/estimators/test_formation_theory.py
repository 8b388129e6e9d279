"""Formations: every printed formula against automatic derivatives or another way to its number; bounds; placement."""

import math

import casadi as ca
import numpy as np
import pytest

from estimators.core.errors import NotPositiveDefiniteError, ParameterError
from estimators.core.information import criteria, error_ellipse, range_information
from estimators.formation import bounds, manoeuvres, observability, placement
from estimators.formation.along import LeaderError, Unknowns, bound_along
from estimators.formation.models import DeadReckoning, InputNoise
from estimators.formation.placement import Reach

LEADERS = np.array([[70.0, 31.0], [-42.0, -56.0], [5.5, -81.0]])
PLACE = np.array([3.0, -7.0])
VELOCITY = np.array([1.3, -0.6])
OPTIMUM = np.array([[1000.0, 0.0], [-500.0, -866.0254037844386], [-500.0, 866.0254037844386]])
LINE = np.array([[0.0, -1000.0], [0.0, 1000.0], [0.0, 2000.0]])


def lie_gradients(place, leaders, velocity, squared=False):
    """Gradients of the zeroth and first Lie derivatives of each range along the follower's motion, by CasADi."""
    x = ca.SX.sym("x", 2)
    rows = []
    for order in (0, 1):
        for leader in leaders:
            away = x - ca.DM(leader)
            h = ca.sumsqr(away) / 2 if squared else ca.sqrt(ca.sumsqr(away))
            for _ in range(order):
                h = ca.jtimes(h, x, ca.DM(velocity))
            rows.append(ca.jacobian(h, x))
    return np.array(ca.Function("obs", [x], [ca.vertcat(*rows)])(place))


def test_the_true_matrix_is_that_of_automatic_derivatives():
    np.testing.assert_allclose(
        observability.true(PLACE, LEADERS, VELOCITY), lie_gradients(PLACE, LEADERS, VELOCITY), rtol=1e-12, atol=1e-15
    )


def test_the_papers_second_column_has_its_velocities_exchanged():
    """p_i = (f_x cos^2 - f_y sin cos) / r as printed is wrong by (f_x - f_y) (cos^2 + sin cos) / r."""
    gradients = lie_gradients(PLACE, LEADERS, VELOCITY)[3:]
    away = PLACE - LEADERS
    r = np.linalg.norm(away, axis=1)
    c, s = (away / r[:, None]).T
    fx, fy = VELOCITY
    np.testing.assert_allclose((fx * s**2 - fy * s * c) / r, gradients[:, 0], rtol=1e-12)
    np.testing.assert_allclose((fy * c**2 - fx * s * c) / r, gradients[:, 1], rtol=1e-12)
    printed = (fx * c**2 - fy * s * c) / r
    np.testing.assert_allclose(printed - gradients[:, 1], (fx - fy) * (c**2 + s * c) / r, rtol=1e-9)


def test_the_simplified_matrix_is_that_of_half_the_squares_and_a_follower_at_rest():
    gradients = lie_gradients(PLACE, LEADERS, np.zeros(2), squared=True)
    np.testing.assert_allclose(observability.simplified(PLACE, LEADERS), gradients[:3], rtol=1e-12)
    np.testing.assert_array_equal(gradients[3:], 0.0)
    # It knows distance: half as far it is half as large; the true one does not change.
    near = PLACE + (LEADERS - PLACE) / 2.0
    np.testing.assert_allclose(observability.simplified(PLACE, near), observability.simplified(PLACE, LEADERS) / 2.0)
    np.testing.assert_allclose(
        observability.true(PLACE, near, np.zeros(2)), observability.true(PLACE, LEADERS, np.zeros(2)), atol=1e-15
    )


def test_in_a_rigid_formation_speed_and_distance_say_nothing():
    leaders_velocity = np.broadcast_to(VELOCITY, LEADERS.shape)
    matrix = observability.true(PLACE, LEADERS, VELOCITY - leaders_velocity)
    np.testing.assert_array_equal(matrix[3:], 0.0)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_replacing_rows_keeps_the_rank_but_not_the_condition(count):
    leaders = LEADERS[:count]
    true, paper = (f(PLACE, leaders, VELOCITY) for f in (observability.true, observability.paper))
    assert np.linalg.matrix_rank(true) == np.linalg.matrix_rank(paper) == 2
    assert abs(observability.condition(true) / observability.condition(paper) - 1.0) > 1e-5


def test_one_leader_tells_nothing_to_a_follower_that_heads_for_it():
    leader = LEADERS[:1]
    ahead = (leader[0] - PLACE) * 0.01
    assert observability.condition(observability.true(PLACE, leader, ahead)) < 1e-12
    assert observability.condition(observability.true(PLACE, leader, ahead[::-1] * (1, -1))) > 1e-3


@pytest.mark.parametrize("scale", [0.01, 1.0, 10.0])
def test_equation_17_is_the_condition_of_the_papers_matrix(scale):
    g = observability.geometry(PLACE, LEADERS * scale, VELOCITY)
    svd = observability.condition(observability.paper(PLACE, LEADERS * scale, VELOCITY))
    assert observability.condition_paper(g) == pytest.approx(svd, rel=1e-11)
    matrix = observability.paper(PLACE, LEADERS * scale, VELOCITY)
    gram = matrix.T @ matrix
    assert (3.0 + g.tau) ** 2 - 4.0 * np.linalg.det(gram) == pytest.approx(9.0 - 4.0 * observability.ja(g), rel=1e-11)
    assert (np.trace(gram), np.linalg.det(gram)) == pytest.approx((3.0 + g.tau, g.s1 + g.tau * g.s2), rel=1e-11)
    # As printed, (-3 - tau - root) / (-3 - tau + root) is the condition number, not its reciprocal.
    root = math.sqrt(9.0 - (4.0 * g.s1 + g.tau * (4.0 * g.s2 - g.tau - 6.0)))
    assert math.sqrt((-3.0 - g.tau - root) / (-3.0 - g.tau + root)) == pytest.approx(1.0 / svd, rel=1e-9)


def test_ja_orders_formations_at_one_tau_only():
    """On the leaders' line and heading along it 1/C is zero at any speed, while Ja falls with it."""
    line = LINE / 10.0
    slow, fast = (observability.geometry((0.0, 0.0), line, (0.0, v)) for v in (1.0, 10.0))
    assert observability.condition_paper(slow) < 1e-7
    assert observability.condition_paper(fast) < 1e-7
    assert observability.ja(fast) < 10.0 * observability.ja(slow) < 0.0
    # Across the line it grows with speed, which the paper's sentence and tables deny.
    slow, fast = (observability.geometry((0.0, 0.0), line, (v, 0.0)) for v in (1.0, 10.0))
    assert observability.condition_paper(fast) == pytest.approx(10.0 * observability.condition_paper(slow), rel=0.01)
    assert observability.condition_paper(slow) == pytest.approx(math.sqrt(slow.tau / 3.0), rel=1e-3)
    for g in (slow, fast):
        c = observability.condition_paper(g)
        assert c / (1.0 + c**2) == pytest.approx(math.sqrt(observability.monotone(g)), rel=1e-9)


def test_equivalence_of_ellipse_information_and_s1():
    """det B = sigma^4 / S1, trace B = n sigma^2 / S1, area = pi sigma^2 / sqrt(S1), of equal ranges."""
    sigma = 1.7
    g = observability.geometry(PLACE, LEADERS, VELOCITY)
    B = bounds.crlb(PLACE, LEADERS, sigma)
    assert np.linalg.det(B) == pytest.approx(sigma**4 / g.s1, rel=1e-9)
    assert np.trace(B) == pytest.approx(3.0 * sigma**2 / g.s1, rel=1e-9)
    assert error_ellipse(B).area == pytest.approx(math.pi * sigma**2 / math.sqrt(g.s1), rel=1e-9)
    unequal = bounds.crlb(PLACE, LEADERS, (1.0, 2.0, 4.0))
    assert np.linalg.det(unequal) != pytest.approx(1.0 / g.s1, rel=0.05)


def test_the_papers_bound_is_nine_times_too_small():
    B, paper = (f((0.0, 0.0), OPTIMUM, 2.0) for f in (bounds.crlb, bounds.crlb_paper))
    np.testing.assert_allclose(B, 9.0 * paper, atol=1e-12)
    assert paper[0, 0] == pytest.approx(0.296, abs=5e-4)
    assert B[0, 0] == pytest.approx(2.667, abs=5e-4)
    dets = (np.linalg.det(B), bounds.crlb_determinant_paper((0.0, 0.0), OPTIMUM, 2.0), np.linalg.det(paper))
    assert dets == pytest.approx((7.11, 0.198, 0.088), abs=5e-3)


def test_the_most_likely_place_has_the_variance_of_the_bound():
    """4000 fixes of one moment; 2 % is about the standard deviation of a variance of so many."""
    rng = np.random.default_rng(11)
    errors = np.zeros((4000, 2))
    z = np.linalg.norm(PLACE - OPTIMUM, axis=1) + 2.0 * rng.standard_normal((4000, 3))
    x = np.tile(PLACE, (4000, 1))
    for _ in range(5):
        away = x[:, None] - OPTIMUM
        r = np.linalg.norm(away, axis=-1)
        H = away / r[..., None]
        x = x + np.linalg.solve(np.swapaxes(H, 1, 2) @ H, np.swapaxes(H, 1, 2) @ (z - r)[..., None])[..., 0]
    errors = x - PLACE
    assert np.trace(np.cov(errors.T)) == pytest.approx(np.trace(bounds.crlb(PLACE, OPTIMUM, 2.0)), rel=0.07)


def test_the_steady_bound_is_where_the_recursion_stays():
    F = range_information(PLACE, LEADERS, (1.0, 2.0, 3.0))
    Q = DeadReckoning().covariance(np.zeros(2), (2.0, 0.7), 1.5)
    P = np.eye(2)
    for _ in range(500):
        P = np.linalg.inv(np.linalg.inv(P + Q) + F)
    np.testing.assert_allclose(bounds.steady(F, Q), P, rtol=1e-9)
    apart = bounds.steady(np.diag([0.5, 0.25]), np.diag([0.3, 0.7]))
    assert np.diagonal(apart) == pytest.approx([bounds.steady_axis(0.3, 2.0), bounds.steady_axis(0.7, 4.0)], rel=1e-9)
    with pytest.raises(NotPositiveDefiniteError):
        bounds.steady(range_information((0.0, 0.0), LINE, 2.0), Q)


def straight(steps, speed=1.0):
    places = np.column_stack((speed * np.arange(steps), np.zeros(steps)))
    return places, np.column_stack((np.full(steps, speed), np.zeros(steps)))


def along(unknown=Unknowns(), steps=120, leaders=OPTIMUM, **options):  # noqa: B008 - immutable
    places, inputs = straight(steps)
    return bound_along(
        places, places[:, None] + leaders, inputs, step=1.0, deviations=(2.0, 2.0, 2.0), unknown=unknown, **options
    )


def test_the_bound_along_a_track_comes_to_the_steady_one():
    steady = bounds.steady_rms((0.0, 0.0), OPTIMUM, 2.0, DeadReckoning(), (1.0, 0.0), 1.0)
    assert along().rms[-1] == pytest.approx(steady, rel=1e-6)


def test_a_late_range_leaves_the_way_since_then():
    """Ranges 5 s late: the bound of 5 s ago and five steps of dead reckoning."""
    late, prompt = along(Unknowns(delay=5.0)), along()
    Q = DeadReckoning().covariance(np.zeros(2), (1.0, 0.0), 1.0)
    np.testing.assert_allclose(late.covariance[-1], prompt.covariance[-6] + 5.0 * Q, rtol=1e-6)


def test_errors_of_leaders_that_last_do_not_average_out():
    """A leader's error of 3 m that lasts hurts more than one as large that changes each second."""
    lasting, brief = (along(Unknowns(leaders=LeaderError(3.0, tau))).rms[-1] for tau in (1000.0, 1.0))
    assert lasting > 1.3 * brief > 1.5 * along().rms[-1]


def test_an_unknown_current_costs_little_once_it_has_been_seen():
    unknown, known = along(Unknowns(current=0.5), steps=300), along(steps=300)
    assert unknown.rms[3] > 1.3 * known.rms[3]
    assert known.rms[-1] < unknown.rms[-1] < 1.1 * known.rms[-1]


def test_a_leader_that_falls_silent_leaves_the_bound_of_the_others():
    two = along(heard=lambda k, leader: leader != 2, steps=250)
    steady = bounds.steady_rms((0.0, 0.0), OPTIMUM[:2], 2.0, DeadReckoning(), (1.0, 0.0), 1.0)
    assert two.rms[-1] == pytest.approx(steady, rel=1e-6)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_the_search_finds_n_squared_over_four(count):
    found = placement.optimise_bearings(np.ones(count))
    F = placement.information_of(found, np.ones(count))
    assert np.linalg.det(F) == pytest.approx(count**2 / 4.0, rel=1e-9) == placement.best_determinant(np.ones(count))
    _, a, e = criteria(F)  # where the optimum can be reached, all criteria agree on it
    assert (a, e) == pytest.approx((count / 4.0, count / 2.0), rel=1e-5)
    if count == 3:
        # At the optimum det is flat: bearings are known to the root of its precision.
        assert np.degrees(np.sort(found)) == pytest.approx([0.0, 60.0, 120.0], abs=1e-3)


@pytest.mark.parametrize(
    "deviations", [(1.0, 2.0, 3.0, 2.5), (2.0, 2.0, 3.0, 2.5), (1.0, 1.4), (1.0, 1.1, 1.2), (3.0, 2.0, 2.0, 2.0, 4.0)]
)
def test_closed_form_of_unequal_ranges_is_the_best_there_is(deviations):
    best = placement.best_determinant(deviations)
    closed = placement.information_of(placement.optimal_bearings(deviations), deviations)
    assert np.linalg.det(closed) == pytest.approx(best, rel=1e-9)
    found = placement.information_of(placement.optimise_bearings(deviations), deviations)
    assert np.linalg.det(found) == pytest.approx(best, rel=1e-6)


def test_noise_of_dead_reckoning_turns_the_optimum():
    """At 10 m/s the follower errs across its course more than along it: bearings gather across the course."""
    Q = DeadReckoning(InputNoise()).covariance(np.zeros(2), (10.0, 0.0), 1.0)
    found = placement.optimise_bearings((2.0, 2.0, 2.0), Q)
    aware, even = (
        float(np.trace(bounds.steady(placement.information_of(theta, (2.0, 2.0, 2.0)), Q)))
        for theta in (found, np.pi * np.arange(3) / 3.0)
    )
    assert aware < 0.97 * even
    assert (np.sin(found) ** 2).sum() > 1.6  # 1.5 if even


def test_moves_keep_to_what_can_be_reached():
    follower, home = np.zeros(2), LINE / 10.0
    objective = placement.snapshot_rms(2.0)
    reach = Reach(distance=120.0, modem=150.0, apart=40.0)
    places = placement.best_formation(follower, home, objective, reach)
    assert (np.linalg.norm(places - home, axis=1) <= 120.0 + 1e-9).all()
    moved = np.linalg.norm(places - home, axis=1) > 0.0
    assert (np.linalg.norm(places, axis=1)[moved] <= 150.0).all()
    gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(3, 1)]
    assert gaps.min() >= 40.0 - 1e-9
    assert objective(follower, places) < 1.02 * 2.0 * math.sqrt(4.0 / 3.0)  # 2 % above the least there is
    one = placement.best_move(follower, home, 0, objective, reach)
    assert objective(follower, np.vstack((one, home[1:]))) < 3.0 < objective(follower, home)
    station = placement.best_station(follower, home, objective, Reach(distance=120.0, modem=300.0, apart=40.0))
    assert objective(station, home) < 3.0
    assert np.linalg.norm(station) <= 120.0 + 1e-9


def test_a_line_turns_weaves_and_staggers_as_it_says():
    rate = math.radians(3.0)
    turned = manoeuvres.rotating_line(LINE, rate)(20.0)  # by 60 deg: east goes to south by west
    np.testing.assert_allclose(turned[1], 1000.0 * np.array([-math.sin(1.0471975511965976), 0.5]), rtol=1e-9)
    assert manoeuvres.greatest_speed(manoeuvres.rotating_line(LINE, rate), 60.0, 0.1) == pytest.approx(
        2000.0 * rate, rel=1e-3
    )
    staggered = manoeuvres.stagger(LINE, 30.0)(0.0)
    np.testing.assert_allclose(np.abs(staggered - LINE), [[30.0, 0.0]] * 3, atol=1e-9)
    assert math.copysign(1.0, staggered[0, 0]) == -math.copysign(1.0, staggered[1, 0])
    swing = np.array([manoeuvres.weave(LINE, 50.0, 40.0)(t) for t in np.arange(0.0, 40.0, 0.5)])
    assert np.abs(swing[:, :, 0]).max() == pytest.approx(50.0, rel=1e-2)
    np.testing.assert_allclose(manoeuvres.mirrored((12.0, 5.0), LINE), (-12.0, 5.0), atol=1e-9)


@pytest.mark.parametrize(
    "make",
    [
        lambda: placement.best_determinant((1.0, 0.0)),
        lambda: placement.optimal_bearings(()),
        lambda: Reach(distance=0.0),
        lambda: Reach(distance=10.0, modem=5.0, apart=6.0),
        lambda: DeadReckoning(InputNoise(0.0, 0.1)),
        lambda: manoeuvres.weave(LINE, 10.0, 0.0),
        lambda: observability.ja(observability.Geometry(2, 1.0, 1.0, 0.0)),
    ],
)
def test_what_cannot_be_is_refused(make):
    with pytest.raises(ParameterError):
        make()
