import dataclasses
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import DOCK, DOCK_HEADING, GO_AROUND, NOSE, empty_log, from_dock, trial_log, truth, writer, writers

from auvsim.analysis.estimates import estimate_errors, estimate_quality, fix_fates, fixes, refusals
from auvsim.analysis.summary import summarise
from auvsim.base.frames import rotation
from auvsim.base.reading import Reading
from auvsim.data.log import VehicleLog
from auvsim.data.phases import phase_at
from auvsim.missions.docking.dock_frame import in_dock_frame, nose_position, to_body
from auvsim.missions.docking.metrics import crossings

SPEED = 1.5  # along the dock axis [m/s]


def straight_pass(cross=0.3, down=0.4, off=0.05, pitch=0.02, start=0.0, attempt=1, phase="final", recorder=None):
    """A recorder of a straight pass along the dock axis; the nose passes the mouth's plane 4.03 s after `start`."""
    recorder = recorder or writer()
    heading = DOCK_HEADING + off
    nose = rotation(0.0, pitch, heading) @ [NOSE, 0.0, 0.0]
    velocity = rotation(0.0, 0.0, DOCK_HEADING) @ [SPEED, 0.0, 0.0]
    recorder.phase(start, phase, attempt)
    for time in np.arange(0.0, 6.0, 0.1):
        along = SPEED * (time - 4.03)
        recorder.truth(truth(start + time, from_dock(along, cross, down) - nose, (0.0, pitch, heading), velocity))
    return recorder


def estimates(recorder, errors, covariance, phase_times=(), initialised=True):
    """Adds a standstill with estimates every 0.5 s whose errors (n, 8) and covariance (8, 8) are given."""
    end = 0.5 * len(errors)
    for time in np.arange(0.0, end + 0.1, 0.1):
        recorder.truth(truth(time, (10.0, -20.0, 3.0), (0.0, 0.0, 3.1), (0.0, 0.0, 0.0), (0.3, -0.2, 0.0)))
    for time, name in phase_times:
        recorder.phase(time, name)
    water = rotation(0.0, 0.0, 3.1).T @ [0.3, -0.2, 0.0]
    for i, e in enumerate(errors):
        position, velocity = (10.0 + e[0], -20.0 + e[1], 3.0), (-water[0] + e[3], -water[1] + e[4], e[5])
        row = (0.5 * i, position, 3.1 + e[2], velocity, (0.3 + e[6], -0.2 + e[7]), covariance, 0, initialised)
        recorder.estimate(*row)
    return recorder.finish("complete", wall_time=1.0)


def quality_of(log: VehicleLog):
    """Quality of the estimate by phase."""
    return estimate_quality(estimate_errors(log), log.phases)


def test_a_straight_pass_misses_by_what_was_put_in():
    log = straight_pass(cross=0.3, down=0.4, off=0.05).finish("complete")
    (crossing,) = crossings(log)
    # The pass is linear in time, so interpolation is exact but for rounding.
    assert crossing.miss_distance == pytest.approx(0.5, abs=1e-9)
    assert (crossing.cross_track, crossing.vertical) == pytest.approx((0.3, 0.4), abs=1e-9)
    assert crossing.heading_error_deg == pytest.approx(math.degrees(0.05), abs=1e-9)
    assert crossing.time == pytest.approx(4.03, abs=1e-9)
    assert (crossing.attempt, crossing.phase) == (1, "final")


def test_heading_error_wraps():
    log = straight_pass(off=math.tau - 0.1).finish("complete")
    assert crossings(log)[0].heading_error_deg == pytest.approx(-math.degrees(0.1), abs=1e-9)


def test_the_last_attempt_counts_and_all_are_listed():
    recorder = straight_pass(cross=3.0, down=0.0, attempt=1)
    straight_pass(cross=-0.4, down=0.3, off=-0.02, start=100.0, attempt=2, recorder=recorder)
    summary = summarise(recorder.finish("complete"))
    assert [c["attempt"] for c in summary["crossings"]] == [1, 2]
    assert [c["miss_distance"] for c in summary["crossings"]] == pytest.approx([3.0, 0.5], abs=1e-9)
    assert summary["miss_distance"] == pytest.approx(0.5, abs=1e-9)
    assert summary["heading_error_deg"] == pytest.approx(-math.degrees(0.02), abs=1e-9)
    assert summary["attempts"] == 2


def test_of_a_bounce_the_first_crossing_counts():
    recorder = straight_pass(cross=0.6, down=0.0)
    straight_pass(cross=0.1, down=0.0, start=10.0, recorder=recorder)
    summary = summarise(recorder.finish("complete"))
    assert len(summary["crossings"]) == 2
    assert summary["miss_distance"] == pytest.approx(0.6, abs=1e-9)


@pytest.mark.parametrize("phase", ["search", "homing", "go_around", "aborted"])
def test_passing_the_plane_elsewhere_is_no_entrance(phase: str):
    summary = summarise(straight_pass(cross=40.0, phase=phase).finish("complete"))
    assert summary["crossings"] == []
    assert summary["miss_distance"] is None


def test_leaving_the_dock_is_no_entrance():
    log = straight_pass().finish("complete")
    position = log["truth"]["position"][::-1].copy()
    backwards = {**log.log.groups, f"vehicles/{log.name}/truth": {**log["truth"], "position": position}}
    assert crossings(dataclasses.replace(log.log, groups=backwards).vehicle()) == ()


def test_nose_and_dock_frame_agree_with_rotation_matrices():
    recorder, rng = writer(), np.random.default_rng(1)
    attitudes = rng.uniform(-1.2, 1.2, (20, 3))
    points = rng.normal(size=(20, 3))
    for i, (attitude, point) in enumerate(zip(attitudes, points, strict=True)):
        recorder.truth(truth(float(i), point, attitude))
    log = recorder.finish("complete")
    noses = [p + rotation(*a) @ [NOSE, 0.0, 0.0] for a, p in zip(attitudes, points, strict=True)]
    np.testing.assert_allclose(nose_position(log), noses, atol=1e-14)  # rounding
    body = [rotation(*a).T @ p for a, p in zip(attitudes, points, strict=True)]
    np.testing.assert_allclose(to_body(log["truth"]["quaternion"], points), body, atol=1e-14)
    world = np.array([from_dock(*p) for p in points])
    np.testing.assert_allclose(in_dock_frame(log.log.structure("dock"), world), points, atol=1e-14)


def test_constant_errors_are_their_own_rms():
    error = np.array([0.3, -0.4, math.radians(2.0), 0.06, 0.08, 0.01, -0.05, 0.12])
    sigma = np.array([0.2, 0.4, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    quality = quality_of(estimates(writer(), [error] * 20, np.diag(sigma**2)))["all"]
    assert quality.samples == 20
    # Constants: only rounding.
    assert quality.position_rms == pytest.approx(0.5, abs=1e-12)
    assert quality.heading_rms_deg == pytest.approx(2.0, abs=1e-10)  # 3.1 rad plus 2 degrees is past pi
    assert quality.velocity_rms == pytest.approx(0.1, abs=1e-12)
    assert quality.current_rms == pytest.approx(0.13, abs=1e-12)
    assert quality.nees_per_dof == pytest.approx((1.5**2 + 1.0**2) / 2.0, abs=1e-12)
    assert quality.coverage_95 == 1.0  # 3.25 < 5.99


def test_nees_of_correlated_gaussian_errors_is_one():
    rng, count = np.random.default_rng(3), 4000
    covariance = np.eye(8) * 0.01
    covariance[:2, :2] = [[4.0, 1.5], [1.5, 1.0]]
    errors = rng.multivariate_normal(np.zeros(8), covariance, size=count)
    quality = quality_of(estimates(writer(), errors, covariance))["all"]
    # The mean of n chi-square(2) / 2 values has the standard deviation 1 / sqrt(n); the share inside, binomial.
    assert quality.nees_per_dof == pytest.approx(1.0, abs=4.0 / math.sqrt(count))
    assert quality.coverage_95 == pytest.approx(0.95, abs=4.0 * math.sqrt(0.95 * 0.05 / count))
    by_hand = np.mean([e[:2] @ np.linalg.inv(covariance[:2, :2]) @ e[:2] for e in errors]) / 2.0
    assert quality.nees_per_dof == pytest.approx(by_hand, rel=1e-9)


def test_phases_split_the_estimates():
    errors = np.zeros((40, 8))
    errors[20:, 0] = 2.0
    log = estimates(writer(), errors, np.eye(8), phase_times=[(0.0, "homing"), (10.0, "final")])
    quality = quality_of(log)
    assert set(quality) == {"all", "homing", "final"}
    assert [quality[name].samples for name in ("all", "homing", "final")] == [40, 20, 20]
    assert (quality["homing"].position_rms, quality["final"].position_rms) == pytest.approx((0.0, 2.0), abs=1e-12)
    assert quality["all"].position_rms == pytest.approx(math.sqrt(2.0), abs=1e-12)
    assert (quality["homing"].nees_per_dof, quality["final"].nees_per_dof) == pytest.approx((0.0, 2.0), abs=1e-12)
    assert phase_at(log, np.array([-0.1, 0.0, 9.9, 10.0, 99.0])).tolist() == [-1, 1, 1, 3, 3]


def test_what_the_latch_holds_does_not_count_among_all():
    errors = np.zeros((40, 8))
    errors[20:, 0] = 2.0
    log = estimates(writer(), errors, np.eye(8), phase_times=[(0.0, "final"), (10.0, "docked")])
    quality = quality_of(log)
    assert (quality["all"].samples, quality["docked"].samples) == (20, 20)
    assert (quality["all"].position_rms, quality["docked"].position_rms) == pytest.approx((0.0, 2.0), abs=1e-12)


def test_estimates_before_initialisation_do_not_count():
    log = estimates(writer(), np.full((10, 8), 50.0), np.eye(8), initialised=False)
    assert summarise(log)["estimate"]["all"]["samples"] == 0


def test_a_covariance_that_is_not_estimated_has_no_nees():
    quality = quality_of(estimates(writer(), np.ones((10, 8)), np.zeros((8, 8))))["all"]
    assert (quality.nees_per_dof, quality.coverage_95) == (None, None)
    assert quality.position_rms == pytest.approx(math.sqrt(2.0), abs=1e-12)


def test_truth_is_interpolated_to_the_time_of_the_estimate():
    recorder = straight_pass(cross=0.0, down=0.0, off=0.0, pitch=0.0)
    time = 2.037  # between two logged truths
    position = from_dock(SPEED * (time - 4.03) - NOSE, 0.0)
    recorder.estimate(time, position, DOCK_HEADING, (SPEED, 0.0, 0.0), (0.0, 0.0), np.eye(8), 0, True)
    quality = SimpleNamespace(**summarise(recorder.finish("complete"))["estimate"]["all"])
    assert quality.position_rms == pytest.approx(0.0, abs=1e-9)  # uniform motion: exact but for rounding
    assert quality.velocity_rms == pytest.approx(0.0, abs=1e-9)


def ended(status: str, *events: tuple[float, str, str]) -> VehicleLog:
    recorder = straight_pass()
    for event in events:
        recorder.event(*event)
    return recorder.finish(status, wall_time=0.5)


def test_how_a_trial_ended():
    cases = [
        (ended("complete", (5.0, "docked", "latched")), (True, None, None, 5.0)),
        (ended("complete", (5.9, "timeout", "600 s")), (False, "timeout", "600 s", 5.9)),
        (ended("complete", (1.0, "aborted", "a"), (2.0, "aborted", "b")), (False, "aborted", "b", 5.9)),
        (ended("diverged", (1.0, "aborted", "a"), (5.9, "diverged", "NaN")), (False, "diverged", "NaN", 5.9)),
        (ended("interrupted", (1.0, "aborted", "a")), (False, "interrupted", None, 5.9)),
        (ended("complete"), (False, "timeout", None, 5.9)),
    ]
    for log, (docked, reason, text, time) in cases:
        summary = summarise(log)
        assert (summary["docked"], summary["failure_reason"], summary["failure_text"]) == (docked, reason, text)
        assert summary["time"] == pytest.approx(time, abs=1e-9)
        assert summary["real_time_factor"] == pytest.approx(5.9 / 0.5, rel=1e-9)


def test_the_docked_phase_is_docking_too():
    recorder = straight_pass()
    recorder.phase(4.5, "docked")
    summary = summarise(recorder.finish("complete"))
    assert (summary["docked"], summary["time"]) == (True, 4.5)


def test_contact_and_fix_counts():
    recorder = writer()
    for row in [(1.0, 10.0, 0.1, "dock"), (1.01, 250.0, 2.6, "dock"), (7.0, 40.0, 3.0, "dock")]:
        recorder.append("contact", row)
    for i, (lost, outlier) in enumerate([(False, False), (True, False), (True, True), (False, True), (False, False)]):
        recorder.reading(Reading("usbl", float(i), i + 1.5, np.zeros(7), i), lost, outlier)
    for refused in (0, 1, 4):
        recorder.estimate(0.0, (0, 0, 0), 0.0, (0, 0, 0), (0, 0), np.eye(8), refused, True)
    summary = summarise(recorder.finish("complete"))
    assert (summary["contact_impulse"], summary["peak_contact_force"]) == (3.0, 250.0)
    counts = (summary["fixes_sent"], summary["fixes_lost"], summary["fixes_outliers"], summary["fixes_refused"])
    assert counts == (5, 2, 1, 4)


def test_fixes_are_where_the_transponder_is():
    transceiver, attitude = np.array([0.5, -0.2, -1.0]), (0.04, -0.05, DOCK_HEADING)  # roll, pitch, heading
    offsets = dict(zip(("forward", "starboard", "down"), transceiver.tolist(), strict=True))
    recorder = writers({"remus100": {}}, {"dock": {f"transceiver_{a}": v for a, v in offsets.items()}})["remus100"]
    places = np.array([[-200.0, 30.0, 3.0], [-5.0, 1.0, 6.0]])
    for i, place in enumerate(places):
        relative = rotation(*attitude).T @ (place - DOCK) - transceiver
        packet = np.array([*relative, attitude[2], attitude[1], attitude[0], 5.0])
        recorder.reading(Reading("usbl", float(i), i + 1.5, packet, i), False, False)
    log = recorder.finish("complete")
    np.testing.assert_allclose(fixes(log), places[:, :2], atol=1e-12)  # rounding at 200 m
    assert fixes(empty_log()).shape == (0, 2)
    # Logs of formats 1 and 2 do not say whose USBL it is: it is that of the mission's dock.
    old = {key: value for key, value in log.attributes.items() if "usbl" not in key}
    groups = {**log.log.group_attributes, "vehicles/remus100": old}
    converted = dataclasses.replace(log.log, group_attributes=groups)
    np.testing.assert_array_equal(fixes(converted.vehicle()), fixes(log))


def test_the_last_decision_on_a_fix_counts():
    """A late fix undoes a refusal, a copy changes nothing, what was lost or never judged was not refused."""
    recorder = writer()
    for i, lost in enumerate((False, False, False, True, False)):
        recorder.reading(Reading("usbl", float(i), math.nan if lost else i + 1.5, np.zeros(7), i), lost, False)
    decisions = [(2.0, "usbl", 0, "outlier"), (3.0, "usbl", 1, "outlier"), (4.0, "usbl", 0, ""), (5.0, "usbl", 2, "")]
    decisions += [(6.0, "usbl", 2, "duplicate"), (7.0, "compass", 1, ""), (0.5, "compass", 0, "not_started")]
    for time, sensor, number, reason in decisions:
        recorder.append("measurements", (time, sensor, float(number), number, not reason, reason, math.nan))
    log = recorder.finish("complete")
    assert fix_fates(log).tolist() == ["", "outlier", "", "", ""]
    times, reasons = refusals(log)
    assert (times.tolist(), reasons) == ([2.0, 3.0, 6.0], ("duplicate", "outlier"))
    assert fix_fates(empty_log()).tolist() == []


def test_sigmas_are_found_by_the_names_of_the_states():
    """An estimator with states in another order, some of its own and not all planar ones."""
    log = estimates(writer(), np.zeros((4, 8)), np.diag(np.arange(1.0, 9.0) ** 2))
    names = ("north", "east", "bias", "current_north", "heading", "surge", "depth", "yaw_rate")
    path = f"vehicles/{log.name}/estimate"
    mean = dataclasses.replace(log.table("estimate")["mean"], labels=names)
    tables = {**log.log.tables, path: {**log.table("estimate"), "mean": mean}}
    errors = estimate_errors(dataclasses.replace(log.log, tables=tables).vehicle())
    np.testing.assert_array_equal(errors.sigma, np.tile([1.0, 2.0, 5.0, 6.0, 0.0, 8.0, 4.0, 0.0], (4, 1)))


def test_summaries_are_strict_json():
    for log in (empty_log(), trial_log(GO_AROUND), ended("diverged")):
        values = summarise(log)
        assert json.loads(json.dumps(values, allow_nan=False)) == values
    recorder = straight_pass()
    recorder.truth(truth(6.0, (math.nan,) * 3))
    recorder.estimate(6.0, (math.nan,) * 3, math.nan, (0, 0, 0), (0, 0), np.eye(8), 0, True)
    values = summarise(recorder.finish("diverged"))
    assert values["real_time_factor"] is None  # no wall time was given
    assert values["estimate"]["all"]["position_rms"] is None
    json.dumps(values, allow_nan=False)


@pytest.mark.parametrize(("off", "pitch", "aligned"), [(0.05, 0.02, True), (0.08, 0.05, False), (0.1, 0.0, False)])
def test_pose_in_the_dock_at_the_end(off: float, pitch: float, aligned: bool):
    """The nose and the angle to the axis of the last sample; 5 degrees are aligned where the dock does not say."""
    recorder = straight_pass(cross=0.03, down=-0.02, off=off, pitch=pitch)
    recorder.phase(5.8, "docked", 1)
    summary = summarise(recorder.finish("complete"))
    found = [summary[f"final_{name}"] for name in ("along", "cross", "down")]
    assert found == pytest.approx([SPEED * (5.9 - 4.03), 0.03, -0.02], abs=1e-9)
    apart = rotation(0.0, pitch, DOCK_HEADING + off)[:, 0] @ rotation(0.0, 0.0, DOCK_HEADING)[:, 0]
    assert summary["final_angle_deg"] == pytest.approx(math.degrees(math.acos(apart)), abs=1e-6)
    assert (summary["docked"], summary["docked_aligned"]) == (True, aligned)


def test_no_pose_where_it_did_not_dock():
    summary = summarise(straight_pass().finish("complete"))
    assert summary["docked_aligned"] is False
    assert summary["final_along"] is None
