"""Travel times: closed form against a traced ray, a wave front that is stepped finely, and water that ends."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from auvsim.acoustics.medium import Medium


def traced(medium, depth, depth_end, across):
    """Travel time of the ray between two points by ray equations in arc length, its launch angle found by shooting."""
    c0, c = medium.sound_speed(depth), medium.sound_speed

    def ray(angle):
        # x' = cos, z' = sin, angle' = -(dc/dz) cos / c by Snell's law, t' = 1 / c
        def rates(_, s):
            _, z, theta, _ = s
            return (math.cos(theta), math.sin(theta), -medium.gradient * math.cos(theta) / c(z), 1.0 / c(z))

        def far(_, s):
            return s[0] - across

        far.terminal = True
        found = solve_ivp(rates, (0.0, 3.0 * across), (0.0, depth, angle, 0.0), events=far, rtol=1e-11, atol=1e-11)
        return found.y[:, -1]

    straight = math.atan2(depth_end - depth, across)
    angle = brentq(lambda a: ray(a)[1] - depth_end, straight - 0.3, straight + 0.3, xtol=1e-13)
    assert c0 > 0.0
    return ray(angle)[3]


@pytest.mark.parametrize(("gradient", "depth", "depth_end", "across"), [
    (0.016, 400.0, 900.0, 2000.0), (-0.2, 120.0, 60.0, 700.0), (0.05, 500.0, 500.0, 1500.0),
])  # fmt: skip
def test_travel_time_is_that_of_a_traced_ray(gradient, depth, depth_end, across):
    medium = Medium(1480.0, gradient)
    time = medium.travel_time((30.0, -40.0, depth), (30.0 + 0.6 * across, -40.0 - 0.8 * across, depth_end))
    assert time == pytest.approx(traced(medium, depth, depth_end, across), rel=1e-8)  # the tracer's tolerance


def test_a_weak_gradient_comes_to_the_uniform_speed():
    """First order in g: the speed at the mean depth. A gradient of 1e-9 1/s is far below what acosh alone resolves."""
    a, b = (0.0, 0.0, 10.0), (300.0, 400.0, 90.0)
    distance = math.dist(a, b)
    assert Medium(1500.0, 1e-9).travel_time(a, b) == pytest.approx(distance / (1500.0 + 50e-9), rel=1e-12)
    assert Medium(1500.0).travel_time(a, b) == distance / 1500.0


def test_no_path_where_the_ray_would_leave_the_water():
    """Sound bends towards slow water: near the surface upwards where speed grows downwards, and the other way round."""
    near = (0.0, 0.0, 5.0)
    downwards = Medium(1500.0, -0.5)  # rays are bent down: their arc bulges upwards, out of the water
    assert math.isnan(downwards.travel_time(near, (800.0, 0.0, 5.0)))
    turning = downwards.turning_point(near, (800.0, 0.0, 5.0))
    assert turning is not None
    # Circle about the depth at which c = 0 (3000 m): radius over half the chord.
    assert turning == pytest.approx((400.0, 0.0, 3000.0 - math.hypot(2995.0, 400.0)))
    assert turning[2] < 0.0
    assert math.isfinite(downwards.travel_time(near, (100.0, 0.0, 5.0)))
    upwards = Medium(1500.0, 0.5, floor=lambda north, east: 20.0 + 0.01 * north)  # bulges downwards, into the floor
    assert math.isnan(upwards.travel_time((0.0, 0.0, 15.0), (900.0, 0.0, 15.0)))  # to 47 m, the floor is at 24.5 m
    assert math.isfinite(upwards.travel_time((0.0, 0.0, 5.0), (300.0, 0.0, 5.0)))  # to 8.7 m
    assert math.isnan(Medium().travel_time((0.0, 0.0, -0.1), (300.0, 0.0, 5.0)))  # out of the water


@pytest.mark.parametrize("medium", [Medium(1500.0), Medium(1450.0, 0.03)], ids=["uniform", "gradient"])
def test_arrival_is_that_of_a_finely_stepped_wave_front(medium):
    """The front has arrived at the first instant at which its travel time to the receiver is no longer than its age."""
    origin, sent = (10.0, 20.0, 30.0), 3.25

    def place(time):
        return 900.0 + 4.0 * time, -300.0 - 30.0 * math.sin(0.3 * time), 60.0 + 0.5 * time

    found = medium.arrival(origin, sent, place, sent)
    low, high = sent, sent + 3.0
    for _ in range(4):  # 1e-3 of the interval, refined four times: to 3e-12 s
        times = np.linspace(low, high, 1001)
        ages = np.array([t - sent - medium.travel_time(origin, place(t)) for t in times])
        first = int(np.argmax(ages >= 0.0))
        low, high = times[first - 1], times[first]
    assert low - 1e-9 <= found <= high + 1e-9
    still = sent + medium.travel_time(origin, place(sent))
    assert abs(found - still) > 1e-3  # 2 m away from where the receiver was: the motion matters
