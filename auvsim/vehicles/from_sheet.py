"""A vehicle of a data sheet: its MJCF, its README, and the list of its numbers, in which every estimate is marked."""

# ruff: noqa: E501 (a row of a table or of MJCF is one line)

import math
from typing import NamedTuple

from auvsim.base import yaml_text
from auvsim.vehicles.estimates import CROSS_FLOW, K_Q, K_T, ROLL, Estimates, estimate
from auvsim.vehicles.sheet import DENSITY, Sheet

STRIPS = 16  # of the hull
CRUISE = 0.75  # share of the top speed for which the gains are made
SERVO_RATE, SERVO_LAG, SHAFT_LAG = 0.7, 0.1, 1.0  # [rad/s, s, s]
FIN_MASS, SCREW_MASS = 0.0006, 0.0026  # each, of the whole
GIVEN = "sheet"
FINS = {
    "rudder_upper": 0.0,
    "rudder_lower": 180.0,
    "plane_port": 90.0,
    "plane_starboard": -90.0,
}  # tip from above [deg]
X_FINS = {"fin_upper_starboard": -45.0, "fin_upper_port": 45.0, "fin_lower_starboard": -135.0, "fin_lower_port": 135.0}


class Number(NamedTuple):
    """A number of a vehicle, and where it came from: `sheet`, or `estimate: ...`, or `assumed`."""

    name: str
    text: str
    unit: str
    source: str


def numbers(sheet: Sheet) -> list[Number]:
    """All numbers of a vehicle that a sheet makes, in the order of its README.

    Raises:
        InputError: No propeller reaches the top speed.
    """
    e, f = estimate(sheet), sheet.fins
    lamb = "estimate: Lamb's factors of a spheroid of that length and diameter"
    drag = "sheet, less the fins' own" if sheet.drag else "estimate: ITTC 1957, Hoerner's form factor, a fifth besides"
    screw = GIVEN if sheet.propeller_diameter else "estimate: drives the top speed at that shaft speed"
    return [
        Number("length, diameter", f"{sheet.length:g}, {sheet.diameter:g}", "m", GIVEN),
        Number("mass, net buoyancy", f"{sheet.mass:g}, {sheet.buoyancy:g}", "kg, N", GIVEN),
        Number("displaced volume", f"{e.volume:.6g}", "m3", "from mass and buoyancy in 1026 kg/m3"),
        Number("centre of gravity below the axis", f"{sheet.centre_of_gravity:g}", "m", GIVEN),
        Number("inertia about the axis, across", _pair(*e.inertia), "kg m2", "estimate: a uniform spheroid"),
        Number("added mass along, across", _pair(*e.added_mass), "kg", lamb),
        Number("added inertia across", f"{e.added_inertia:.4g}", "kg m2", lamb),
        Number("surge drag X_uu", f"{e.surge_drag:.4g}", "kg/m", drag),
        Number("roll damping K_p", f"{e.roll_damping:.3g}", "N m s", f"estimate: damping ratio {ROLL:g} at rest"),
        Number("cross-flow drag", f"{CROSS_FLOW:g}", "-", "estimate: strip theory, a cylinder (Hoerner 1965)"),
        Number("body lift, its place", _pair(e.body_lift, e.body_lift_x), "kg/m, m", "estimate: Hoerner 1965"),
        Number("area of a fin", f"{e.fin_area:.4g}", "m2", GIVEN),
        Number("lift slope of a fin", f"{e.fin_slope:.4g}", "1/rad", "estimate: from the aspect ratio, doubled by the hull"),
        Number("place, limit of the fins", f"{-f.place:g}, {f.limit_deg:g}", "m, deg", GIVEN),
        Number("stall, induced drag of a fin", _pair(0.35, e.fin_induced), "rad, -", "estimate: low aspect, 1/(pi e AR)"),
        Number("profile, normal drag, lift astern", "0.01, 1.2, 0.7", "-", "assumed, as of the REMUS-100"),
        Number("servo: lag, rate; shaft: lag", f"{SERVO_LAG:g}, {SERVO_RATE:g}; {SHAFT_LAG:g}", "s, rad/s, s", "assumed"),
        Number("propeller diameter", f"{e.propeller_diameter:.4g}", "m", screw),
        Number("K_T, K_Q at J = 0, factor", f"{K_T[0]:g}, {K_Q[0]:g}, {e.thrust_factor:.3g}", "-", "estimate: Wageningen, the "
               "factor drives the top speed"),
        Number("shaft limit", f"{sheet.shaft_rpm:g}", "rpm", GIVEN),
    ]  # fmt: skip


def readme(sheet: Sheet) -> str:
    """The README of a vehicle: each number with its source, and the sheet that it came from."""
    lines = [f"| {n.name} | {n.text} | {n.unit} | {n.source} |" for n in numbers(sheet)]
    head = (
        f"# {sheet.name}\n\nMade from a data sheet by `auvsim vehicle --from`. Estimates are what literature gives where nothing is "
        "measured: they err by 20 to 50 %.\nReplace them as you learn more; `auvsim identify` learns from logs.\n\n"
        "| what | value | unit | source |\n|---|---|---|---|\n"
    )
    return (
        head + "\n".join(lines) + f"\n\n## The sheet\n\n```yaml\n{yaml_text.dump(sheet.model_dump(mode='json'))}```\n"
    )


def mjcf(sheet: Sheet) -> str:
    """The MJCF of a vehicle.

    Raises:
        InputError: No propeller reaches the top speed.
    """
    e = estimate(sheet)
    fins = FINS if sheet.fins.tail == "cross" else X_FINS
    return _TEMPLATE.format(
        name=sheet.name,
        limit=math.radians(sheet.fins.limit_deg),
        kp=2.0 / SERVO_LAG,
        force=2.0 * SERVO_RATE,
        hull=_hull(sheet, e),
        fins="".join(_fin(name, tip, sheet) for name, tip in fins.items()),
        propeller=_propeller(sheet, e),
        servos="".join(f'    <position name="{name}" class="fin" joint="{name}"/>\n' for name in fins),
        shaft=sheet.shaft_rpm * math.pi / 30.0,
        numerics=_numerics(sheet, e, fins),
    )


def controller(sheet: Sheet) -> str:
    """Settings of the autopilot: gains that accelerate turns by 2 and pitch by 2.5 rad/s2 per rad at the cruising speed.

    More would make it swing, since its smoothing and the servos are late; what the fins are worth differs by a factor of six.
    """
    e = estimate(sheet)
    speed = CRUISE * sheet.top_speed
    moment = DENSITY * speed**2 * e.fin_area * e.fin_slope * sheet.fins.place  # of two fins, per rad
    worth = moment / (e.inertia[1] + e.added_inertia)  # [1/s2]
    heading, pitch = min(2.0, 2.0 / worth), min(2.5, 2.5 / worth)
    gains = {
        "heading_gain": heading,
        "yaw_rate_gain": 0.7 * heading,
        "pitch_gain": pitch,
        "pitch_rate_gain": 0.5 * pitch,
    }
    lines = [f"{name}: {value:.2g}\n" for name, value in gains.items()]
    return "# Estimates from a data sheet: gains in inverse proportion to what the fins turn.\n" + "".join(lines)


def _pair(one: float, other: float) -> str:
    return f"{one:.4g}, {other:.4g}"


def _hull(sheet: Sheet, e: Estimates) -> str:
    a, r, m = 0.5 * sheet.length, 0.5 * sheet.diameter, sheet.mass
    fins, screw = 4 * FIN_MASS * m, SCREW_MASS * m
    own = m - fins - screw
    # The whole has its centre amidships; the hull's own is a little ahead of it.
    ahead = (fins * sheet.fins.place + screw * (a + 0.02)) / own
    below, (i_x, i_y) = sheet.centre_of_gravity * m / own, e.inertia
    tail = fins * sheet.fins.place**2 + screw * a * a
    end = max(-sheet.fins.place, -a + 1.5 * r)
    return f"""      <inertial pos="{ahead:.6g} 0 {-below:.6g}" mass="{own:.6g}" diaginertia="{i_x:.6g} {i_y - tail:.6g} {i_y - tail:.6g}"/>
      <geom name="hull" type="capsule" size="{r:.5g}" fromto="{end + r:.5g} 0 0 {a - r:.5g} 0 0" mass="0" rgba="0 0 0 0" group="3"/>
      <geom name="tail" type="capsule" size="{0.4 * r:.5g}" fromto="{-a + 0.4 * r:.5g} 0 0 {end + r:.5g} 0 0" mass="0" rgba="0 0 0 0" group="3"/>
      <geom class="visual" type="capsule" size="{r:.5g}" fromto="{end + 2.0 * r:.5g} 0 0 {a - r:.5g} 0 0" material="hull"/>
      <geom class="visual" type="ellipsoid" size="{0.5 * (end + 2.0 * r + a):.5g} {r:.5g} {r:.5g}" pos="{0.5 * (end + 2.0 * r - a):.5g} 0 0" material="hull"/>
      <site name="nose" pos="{a:.6g} 0 0" size="0.01" rgba="0 0 0 0"/>
"""


def _fin(name: str, tip: float, sheet: Sheet) -> str:
    """A fin whose span points to an angle [deg] from above, to port; hinges of opposite fins are parallel."""
    f, angle = sheet.fins, math.radians(tip)
    middle = 0.5 * sheet.diameter + 0.5 * f.span
    y, z = middle * math.sin(angle), middle * math.cos(angle)
    turned = _hinge(tip)
    quat = f"{math.cos(0.5 * turned):.12g} {math.sin(0.5 * turned):.12g} 0 0"
    return f"""      <body name="{name}" pos="{-f.place:.6g} {y:.6g} {z:.6g}" quat="{quat}">
        <joint name="{name}" class="fin"/>
        <geom class="fin" size="{0.5 * f.chord:.5g} {0.05 * f.chord:.5g} {0.5 * f.span:.5g}" mass="{FIN_MASS * sheet.mass:.4g}"/>
      </body>
"""


def _hinge(tip: float) -> float:
    """Angle about the axis ahead of a fin's hinge [rad]: turned to starboard from above, so that it dives at 90 deg."""
    return math.radians((-tip + 90.0) % 180.0 - 90.0) if abs(tip) != 90.0 else math.pi / 2.0


def _propeller(sheet: Sheet, e: Estimates) -> str:
    d = e.propeller_diameter
    return f"""      <body name="propeller" pos="{-0.5 * sheet.length - 0.02:.6g} 0 0">
        <joint name="shaft" axis="1 0 0" armature="10"/>
        <geom class="visual" type="ellipsoid" size="{0.15 * d:.4g} {0.13 * d:.4g} {0.13 * d:.4g}" material="dark"/>
        <geom class="visual" type="box" pos="0 0 {0.25 * d:.4g}" euler="0 0 0.6" size="0.004 {0.1 * d:.4g} {0.25 * d:.4g}" material="dark"/>
        <geom class="visual" type="box" pos="0 0 {-0.25 * d:.4g}" euler="0 0 -0.6" size="0.004 {0.1 * d:.4g} {0.25 * d:.4g}" material="dark"/>
        <inertial pos="0 0 0" mass="{SCREW_MASS * sheet.mass:.4g}" diaginertia="0.0001 0.0001 0.0001"/>
      </body>
"""


def _numerics(sheet: Sheet, e: Estimates, fins: dict[str, float]) -> str:
    along, across = e.added_mass
    step = sheet.length / STRIPS
    strips = [-0.5 * sheet.length + (k + 0.5) * step for k in range(STRIPS)]
    found = {
        "hull_added_mass": _diagonal(along, across, across, 0.0, e.added_inertia, e.added_inertia),
        "hull_linear_damping": _diagonal(0.0, 0.0, 0.0, e.roll_damping, 0.0, 0.0),
        "hull_quadratic_damping": _diagonal(e.surge_drag, 0.0, 0.0, 0.0, 0.0, 0.0),
        "hull_displaced_volume": f"{e.volume:.8g}",
        "hull_body_lift": f"{e.body_lift:.5g}",
        "hull_body_lift_x": f"{e.body_lift_x:.5g}",
        "hull_cross_flow_drag": f"{CROSS_FLOW:g}",
        "hull_strip_x": " ".join(f"{x:.5g}" for x in strips),
        "hull_strip_area": " ".join([f"{step * sheet.diameter:.5g}"] * STRIPS),
        "fin_lift_slope": f"{e.fin_slope:.5g}",
        "fin_stall_angle": "0.35",
        "fin_drag": "0.01",
        "fin_induced_drag": f"{e.fin_induced:.4g}",
        "fin_normal_drag": "1.2",
        "fin_astern_lift": "0.7",
        **{f"{name}_area": f"{e.fin_area:.5g}" for name in fins},
        "propeller_diameter": f"{e.propeller_diameter:.6g}",
        "propeller_thrust_coefficients": " ".join(f"{e.thrust_factor * k:.6g}" for k in K_T),
        "propeller_torque_coefficients": f"{K_Q[0]:g} {K_Q[1]:g}",
        "propeller_wake_fraction": "0.056",
        "propeller_thrust_deduction": "0.1",
        "propeller_swirl_recovery": "0.9",
        "allocation_rudder": " ".join(f"{round(math.cos(_hinge(tip)), 9) + 0.0:g}" for tip in fins.values()),
        "allocation_elevator": " ".join(f"{round(math.sin(_hinge(tip)), 9) + 0.0:g}" for tip in fins.values()),
    }
    return "".join(f'    <numeric name="{name}" data="{data}"/>\n' for name, data in found.items())


def _diagonal(*values: float) -> str:
    return "  ".join(" ".join(f"{v:.6g}" if i == j else "0" for j in range(6)) for i, v in enumerate(values))


_TEMPLATE = """<mujoco model="{name}">
  <!-- Made from a data sheet; README.md beside this file says which numbers are estimates. -->
  <compiler angle="radian"/>
  <size nuser_body="197" nuserdata="24"/>
  <default>
    <geom condim="4" friction="0.2 0.005 0.0001"/>
    <default class="visual">
      <geom contype="0" conaffinity="0" group="1" mass="0"/>
    </default>
    <default class="fin">
      <geom type="box" material="control_surface"/>
      <joint axis="0 0 1" range="-{limit:.6g} {limit:.6g}" damping="2" armature="0.02"/>
      <position kp="{kp:g}" forcerange="-{force:g} {force:g}" ctrlrange="-{limit:.6g} {limit:.6g}"/>
    </default>
  </default>
  <asset>
    <material name="hull" rgba="0.85 0.87 0.9 1" specular="0.4" shininess="0.5"/>
    <material name="control_surface" rgba="0.85 0.2 0.1 1"/>
    <material name="dark" rgba="0.12 0.12 0.14 1"/>
  </asset>
  <worldbody>
    <body name="hull">
{hull}{fins}{propeller}    </body>
  </worldbody>
  <actuator>
{servos}    <velocity name="shaft" joint="shaft" kv="10" ctrlrange="-{shaft:.6g} {shaft:.6g}"/>
  </actuator>
  <custom>
{numerics}  </custom>
</mujoco>
"""
