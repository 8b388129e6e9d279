"""Force of strained water on a hull (Galper & Miloh 1995): closed forms, an independent flow solution, and energy."""

import itertools

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, Rigid, acceleration, body_force, dense, free_body, set_motion, set_water
from scipy.spatial.transform import Rotation

PLANES = [(0, 1), (0, 2), (1, 2)]
LENGTH, RADIUS = 0.8, 0.8 / 8.4  # half axes of a spheroid of the REMUS-100's slenderness [m]
VOLUME = 4.0 / 3.0 * np.pi * LENGTH * RADIUS**2


def strain(plane, rate, angle=0.0):
    """Gradient (3, 3) of plane strain, stretching at `angle` from the plane's first axis."""
    i, j = plane
    E = np.zeros((3, 3))
    E[i, i], E[j, j] = rate * np.cos(2.0 * angle), -rate * np.cos(2.0 * angle)
    E[i, j] = E[j, i] = rate * np.sin(2.0 * angle)
    return E


def lamb():
    """Added masses (3,) along the axes of the spheroid (Lamb 1932, sec. 114 and 373)."""
    e = np.sqrt(1.0 - (RADIUS / LENGTH) ** 2)
    logarithm = np.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e**2) / e**3 * (0.5 * logarithm - e)
    beta = 1.0 / e**2 - (1.0 - e**2) / (2.0 * e**3) * logarithm
    return DENSITY * VOLUME * np.array([alpha / (2 - alpha), beta / (2 - beta), beta / (2 - beta)])


def spheroid():
    """The hull, without drag; its rotational added mass plays no part where it does not turn."""
    return free_body(added_mass=np.diag([*lamb(), 0.01, 3.0, 3.0]), volume=VOLUME)


def force(model, velocity, gradient, position=(0, 0, 0), rotation=None):
    """Force and moment (6,), in body axes, on a hull that moves at `velocity` (NED) in the water `G x`."""
    data = mujoco.MjData(model)
    set_water(data, gradient=gradient)
    R = np.eye(3) if rotation is None else rotation
    set_motion(model, data, [*(R.T @ velocity), 0, 0, 0], rotation, position)
    return body_force(model, data)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
def test_a_sphere_in_plane_strain_feels_the_acceleration_of_the_water_alone(plane, angle):
    """rho V Du/Dt + a Du/Dt, whatever its velocity: (A E - E A) v_r is zero for a = rho V / 2."""
    volume = 0.02
    added = 0.5 * DENSITY * volume
    model = free_body(added_mass=np.diag([added] * 3 + [0.0] * 3), volume=volume)
    E, x, V = strain(plane, 0.3, angle), np.array([1.0, -2.0, 0.5]), np.array([1.5, 0.4, -0.3])
    found = force(model, V, E, x)
    assert found[:3] == pytest.approx(1.5 * DENSITY * volume * E @ E @ x, abs=1e-12)  # rounding of some 10 N
    assert np.abs(found[3:]).max() < 1e-12


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
def test_a_slender_spheroid_in_plane_strain(plane, angle):
    """F = (rho V + A) E E x + (A E - E A) v_r, element by element; the moment is Munk's."""
    model = spheroid()
    a = lamb()
    E, x, V = strain(plane, 0.3, angle), np.array([1.0, -2.0, 0.5]), np.array([1.5, 0.4, -0.3])
    v = V - E @ x
    found = force(model, V, E, x)
    extra = [sum((a[i] - a[j]) * E[i, j] * v[j] for j in range(3)) for i in range(3)]
    expected = (DENSITY * VOLUME + a) * (E @ E @ x) + extra
    assert found[:3] == pytest.approx(expected, abs=1e-11)  # rounding
    assert found[3:] == pytest.approx(np.cross(a * v, v), abs=1e-11)


def test_slender_body_theory_gives_the_same_side_force():
    """d(m_a w)/dt of the sections (Lighthill 1960), as an integral along a hull with pointed ends.

    A section at s sees w(s) = v - e s, v being the hull's sway through the water and e the water's dv/dx; swept past
    by the surge, its added momentum changes at (d/dt - U d/ds)(m_a w). In all, m_a e U, where x-added mass is none.
    """
    e, U, sections = 0.2, 1.5, 30.0  # [1/s], [m/s], added mass m_a [kg]
    model = free_body(added_mass=np.diag([0.0, sections, sections, 0.0, 0.0, 0.0]))
    assert force(model, np.array([U, 0.0, 0.0]), strain((0, 1), e, np.pi / 4))[1] == pytest.approx(sections * e * U)


class Flow:
    """Potential flow about the spheroid by multipoles on the line between its foci (Chwang & Wu 1974).

    Strengths of sources, doublets and quadrupoles are fitted to the condition on the wall, which they meet to rounding;
    nothing here knows added masses.
    """

    def __init__(self):
        focus = np.sqrt(LENGTH**2 - RADIUS**2)
        t, weights = np.polynomial.legendre.leggauss(100)  # pressure has poles at t = 1.007: 1e-10 off
        azimuth = 2.0 * np.pi * np.arange(12) / 12
        t, p = (grid.ravel() for grid in np.meshgrid(t, azimuth, indexing="ij"))
        y, z = np.sqrt(1.0 - t**2) * np.cos(p), np.sqrt(1.0 - t**2) * np.sin(p)
        self.points = np.stack([LENGTH * t, RADIUS * y, RADIUS * z], axis=1)
        area = np.repeat(weights, 12) * 2.0 * np.pi / 12
        self.surface = area[:, None] * np.stack([t, y, z], axis=1) * [RADIUS**2, LENGTH * RADIUS, LENGTH * RADIUS]
        self.normals = self.surface / np.linalg.norm(self.surface, axis=1)[:, None]
        nodes, line = np.polynomial.legendre.leggauss(400)
        arm = self.points[:, None, :] - np.stack([focus * nodes, 0 * nodes, 0 * nodes], axis=1)
        distance = np.linalg.norm(arm, axis=2)
        _, y, z = self.points.T
        none, one = np.zeros_like(y), np.ones_like(y)
        potentials, velocities = [], []
        # Of order m: a harmonic polynomial of degree m across the line and its gradient, over distance^(2 m + 1).
        for m, polynomial, gradient in (
            (0, one, (none, none, none)),
            (1, y, (none, one, none)),
            (1, z, (none, none, one)),
            (2, y * z, (none, z, y)),
            (2, y * y - z * z, (none, 2 * y, -2 * z)),
        ):
            for k in range(3):
                density = line * (1.0 - nodes**2) ** m * nodes**k / distance ** (2 * m + 1)
                potentials.append(polynomial * density.sum(axis=1))
                inward = np.einsum("ij,ijk->ik", density / distance**2, arm)
                velocities.append(np.stack(gradient, axis=1) * density.sum(axis=1)[:, None])
                velocities[-1] -= (2 * m + 1) * polynomial[:, None] * inward
        self.potentials, self.velocities = np.stack(potentials, axis=1), np.stack(velocities, axis=1)
        self.walls = np.einsum("ijk,ik->ij", self.velocities, self.normals)

    def strengths(self, wall):
        """Strengths (k,) whose normal velocity on the wall is that of `wall` (n, 3)."""
        wanted = np.einsum("ij,ij->i", wall, self.normals)
        found = np.linalg.lstsq(self.walls, wanted, rcond=None)[0]
        assert np.abs(self.walls @ found - wanted).max() < 1e-8  # [m/s]
        return found

    def force(self, velocity, E, place):
        """Force and moment (6,) by Bernoulli's pressure on the spheroid that moves through the steady water E x."""
        water = (self.points + place) @ E
        flow = self.strengths(velocity - water)
        change = self.strengths(np.tile(-E @ velocity, (len(self.points), 1)))  # the wall meets other water
        disturbance = np.einsum("ijk,j->ik", self.velocities, flow)
        speeds = ((water + disturbance) ** 2).sum(axis=1)
        pressure = -DENSITY * (self.potentials @ change - disturbance @ velocity + 0.5 * speeds)
        push = -pressure[:, None] * self.surface
        return np.concatenate([push.sum(axis=0), np.cross(self.points, push).sum(axis=0)])


@pytest.fixture(scope="module")
def flow():
    return Flow()


def test_the_flow_solution_knows_the_added_masses(flow):
    """Two closed forms that the pressure must give before it may judge: Munk's moment, and rho V + A at rest."""
    V = np.array([1.5, 0.1, -0.05])
    still = flow.force(V, np.zeros((3, 3)), np.zeros(3))
    assert still == pytest.approx([0, 0, 0, *np.cross(lamb() * V, V)], abs=1e-5)
    E, x = strain((0, 1), 0.05, 0.2), np.array([2.0, 1.0, 0.0])
    carried = flow.force(E @ x, E, x)
    assert carried[:3] == pytest.approx(DENSITY * VOLUME * E @ E @ x + lamb() * (E @ E @ x), rel=1e-5)


@pytest.mark.parametrize("plane", PLANES)
def test_force_in_strain_is_that_of_the_pressure_of_the_flow(flow, plane):
    """The added mass times the water's acceleration alone misses most of the side force, and has its sign wrong."""
    model = spheroid()
    V, x = np.array([1.5, 0.1, -0.05]), np.array([0.3, -0.94, 0.4])
    E = strain(plane, 0.05, np.pi / 4 - 0.1)
    found, truth = force(model, V, E, x), flow.force(V, E, x)
    assert found[:3] == pytest.approx(truth[:3], abs=1e-4)
    # What the moment leaves out is of the order M_A E^2, here 3.4 kg m2 x 0.0025 1/s2 = 0.0085 N m.
    assert found[3:] == pytest.approx(truth[3:], abs=0.01)


def test_side_force_of_a_transit_through_strain(flow):
    """1.5 m/s across water that turns aside by 0.05 m/s a metre: 2.1 N, where A Du/Dt is zero."""
    V, E = np.array([1.5, 0.1, -0.05]), strain((0, 1), 0.05, np.pi / 4)
    found, truth = force(spheroid(), V, E), flow.force(V, E, np.zeros(3))
    assert truth[1] == pytest.approx((lamb()[1] - lamb()[0]) * 0.05 * 1.5, rel=1e-4)
    assert found[1] == pytest.approx(truth[1], rel=1e-4)


@pytest.mark.parametrize("plane", PLANES)
def test_power_of_force_and_moment_is_that_of_the_energy_in_strain(plane):
    """Steady irrotational water conserves V p + omega h - T_A + T_RB - rho V u^2 / 2, for a dense (6, 6) added mass.

    Its rate is taken by central differences along the motion that the model's accelerations give.
    """
    added, volume, rigid = dense(3, 20.0, 2.0), 0.015, Rigid(mass=12.0)
    E, random = strain(plane, 0.3, 0.4), np.random.default_rng(5)
    model = free_body(added_mass=added, rigid=rigid, volume=volume)
    data = mujoco.MjData(model)
    set_water(data, gradient=E)

    def energy(x, R, nu):
        u = E @ x
        relative = nu - np.concatenate([R.T @ u, np.zeros(3)])
        impulse = added @ relative
        bodily = 0.5 * nu @ rigid.matrix @ nu - 0.5 * DENSITY * volume * u @ u
        return nu @ impulse - 0.5 * relative @ impulse + bodily

    for _ in range(10):
        x, nu, R = random.uniform(-3, 3, 3), random.uniform(-1, 1, 6), Rotation.random(rng=random)
        set_motion(model, data, nu, R.as_matrix(), x)
        change, step = acceleration(model, data), 1e-4

        def later(time, x=x, nu=nu, R=R, change=change):
            turned = (R * Rotation.from_rotvec(time * nu[3:])).as_matrix()
            return energy(x + time * R.apply(nu[:3]), turned, nu + time * change)

        # Terms of the power are some 10 W; the differences' own error is step^2 and 1e-14 / step of rounding.
        assert later(step) - later(-step) == pytest.approx(0.0, abs=2 * step * 1e-5)


def test_a_neutral_hull_at_rest_in_the_water_stays_with_it():
    """In rotational shear too: no v_r, no force beyond rho V Du/Dt and A Du/Dt."""
    G = np.array([[0.0, 0.1, 0.3], [-0.2, 0.0, 0.0], [0.1, 0.0, 0.05]])
    model, x = spheroid(), np.array([1.0, 2.0, 3.0])
    expected = (DENSITY * VOLUME + lamb()) * (G @ G @ x)
    assert force(model, G @ x, G, x)[:3] == pytest.approx(expected, abs=1e-11)


def test_lift_of_a_sphere_in_rotational_shear_has_the_coefficient_one_half():
    """Auton, Hunt & Prud'homme 1988: rho V / 2 (u - V) x curl u, in each of the planes."""
    volume = 0.02
    model = free_body(added_mass=np.diag([0.5 * DENSITY * volume] * 3 + [0.0] * 3), volume=volume)
    for i, j in itertools.permutations(range(3), 2):
        W = np.zeros((3, 3))
        W[i, j], W[j, i] = 0.2, -0.2
        curl = np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])
        V = np.array([1.5, 0.4, -0.3])
        assert force(model, V, W)[:3] == pytest.approx(0.5 * DENSITY * volume * np.cross(-V, curl), abs=1e-12)
