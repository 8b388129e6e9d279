"""What `equip` reads, where it puts it, and every way in which a model is refused: one line that names the thing."""

import itertools

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.base.frames import flip_matrix
from auvsim.physics import fluid, hydrodynamics
from auvsim.physics.forces import DERIVED, FIN, HEAD, HULL, PROPELLER, RECORD, STRIPS
from auvsim.vehicles import library

RANDOM = np.random.default_rng(0)
FACTOR = RANDOM.uniform(-1.0, 1.0, (6, 6)) + 2.0 * np.eye(6)
ADDED = FACTOR @ FACTOR.T


def text(value):
    return " ".join(repr(float(number)) for number in np.ravel(value))


FIELDS = {
    "hull_added_mass": text(ADDED),
    "hull_displaced_volume": "0.01",
    "fin_area": "0.01",
    "fin_lift_slope": "3",
    "fin_stall_angle": "0.3",
    "screw_diameter": "0.14",
    "screw_thrust_coefficients": "0.45 -0.4",
    "screw_torque_coefficients": "0.07 -0.06",
}


def model(
    fields=None,
    *,
    without=(),
    size=f'nuser_body="{RECORD}" nuserdata="{fluid.WATER}"',
    option="",
    joint="<freejoint/>",
    centre="0 0 -0.02",
    shaft='<joint name="shaft" axis="1 0 0"/>',
    hull_joint="",
    more="",
):
    """A hull with a fin and a screw, with one thing changed."""
    numbers = {name: value for name, value in (FIELDS | (fields or {})).items() if name not in without}
    custom = "".join(f'<numeric name="{name}" data="{value}"/>' for name, value in numbers.items())
    frame = (
        '<inertial pos="0 0 0" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>'  # MuJoCo wants it where the hull is hinged
    )
    screw = f'<body name="screw" pos="-0.8 0 0">{shaft}<inertial pos="0 0 0" mass="0.1" diaginertia="1 1 1"/></body>'
    hull = (
        f'<body name="hull">{hull_joint}<inertial pos="{centre}" mass="10" diaginertia="1 1 1"/>'
        f'<body name="fin" pos="-0.7 0 0"/>{screw}</body>'
    )
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><size {size}/><option {option}/>"
        f'<worldbody><body name="boat">{joint}{frame}{hull}</body>{more}</worldbody><custom>{custom}</custom></mujoco>'
    )


def refusal(changed, density=1026.0):
    """The one line with which `equip` refuses a model."""
    with pytest.raises(InputError) as caught:
        hydrodynamics.equip(changed, density)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
    return str(caught.value)


def test_records_are_in_mujocos_axes_and_the_rest_is_zero():
    m = model({"hull_linear_damping": text(3.0 * ADDED), "hull_strip_x": "-0.5 0.5", "hull_strip_area": "0.1 0.2"})
    assert hydrodynamics.equip(m, 1000.0) == {"boat": 0}
    record = m.body_user[m.body("hull").id]
    assert record[:HEAD].tolist() == [1.0, 0.0, 1000.0]

    def part(name, table=HULL, record=record):
        at, count = table[name]
        return record[at : at + count]

    assert part("added_mass").reshape(6, 6) == pytest.approx(flip_matrix(ADDED), abs=1e-14)  # printed to the last digit
    assert part("linear_damping") == pytest.approx(3.0 * part("added_mass"), rel=1e-14)
    assert part("strip_x").tolist() == [-0.5, 0.5] + [0.0] * (STRIPS - 2)
    assert not part("quadratic_damping").any()
    fin, screw = m.body_user[m.body("fin").id], m.body_user[m.body("screw").id]
    assert (fin[0], screw[0]) == (2.0, 3.0)
    assert part("stall_angle", FIN, fin) == pytest.approx([0.3])
    assert part("torque_coefficients", PROPELLER, screw) == pytest.approx([0.07, -0.06])
    assert not m.body_user[m.body("boat").id].any()


def test_tables_do_not_overlap_and_fit_the_record():
    for table in (HULL | DERIVED, FIN, PROPELLER):
        spans = sorted(table.values())
        assert spans[0][0] == HEAD
        assert all(at + count == following for (at, count), (following, _) in itertools.pairwise(spans))
        assert sum(spans[-1]) <= RECORD
    assert sum(max((HULL | DERIVED).values())) == RECORD


def test_two_vehicles_have_two_slots_of_water():
    other = (
        '<body name="second"><freejoint/><inertial pos="0 0 -0.1" mass="1" diaginertia="1 1 1"/></body>'
        '<body name="ball"><freejoint/><geom size="0.1"/></body>'
    )
    fields = {"second_added_mass": text(np.eye(6)), "second_displaced_volume": "0.001"}
    m = model(fields, size=f'nuser_body="{RECORD}" nuserdata="{2 * fluid.WATER}"', more=other)
    assert hydrodynamics.equip(m) == {"boat": 0, "second": fluid.WATER}
    assert m.body_user[m.body("second").id, 1] == fluid.WATER
    message = refusal(model(fields, more=other))
    assert message == f"2 vehicles need <size nuserdata='{2 * fluid.WATER}'>, not {fluid.WATER}"


def test_a_model_without_fields_is_left_alone():
    m = mujoco.MjModel.from_xml_string(
        '<mujoco><size nuser_body="2"/><worldbody><body name="b"><freejoint/><geom size="1"/></body></worldbody>'
        '<custom><numeric name="gain" data="3"/></custom></mujoco>'
    )
    before = m.body_invweight0.copy()
    assert hydrodynamics.equip(m) == {}
    assert not m.body_user.any()
    assert np.array_equal(m.body_invweight0, before)


def test_equipping_twice_is_equipping_once():
    m = model()
    hydrodynamics.equip(m)
    first = m.body_user.copy(), m.body_invweight0.copy(), m.dof_invweight0.copy()
    hydrodynamics.equip(m)
    for before, after in zip(first, (m.body_user, m.body_invweight0, m.dof_invweight0), strict=True):
        assert np.array_equal(before, after)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"hull_wings": "1"}, "hull 'hull' has no field 'wings'; there are added_mass"),
        ({"keel_added_mass": "1"}, "numeric 'keel_added_mass' names no body; bodies: world, boat, hull, fin, screw"),
        (
            {"boat_stall_angle": "1"},
            "body 'boat' has the fields stall_angle but no boat_added_mass or boat_area or boat_diam",
        ),
        ({"hull_added_mass": "1 2 3"}, "'hull_added_mass' has 3 numbers instead of 36"),
        ({"screw_thrust_coefficients": "1"}, "'screw_thrust_coefficients' has 1 numbers instead of 2"),
        ({"fin_area": "nan"}, "'fin_area' is not finite"),
        ({"hull_body_lift": "inf"}, "'hull_body_lift' is not finite"),
        ({"fin_area": "-0.1"}, "'fin_area' is negative: -0.1"),
        ({"hull_displaced_volume": "-1"}, "'hull_displaced_volume' is negative: -1"),
        ({"hull_added_mass": text(-ADDED)}, "'hull_added_mass' is not positive semidefinite (M_A and D are positive"),
        ({"hull_added_mass": text(FACTOR)}, "'hull_added_mass' is not symmetric"),
        ({"hull_linear_damping": text(-np.eye(6))}, "'hull_linear_damping' is not positive semidefinite"),
        ({"hull_quadratic_damping": text(-np.eye(6))}, "'hull_quadratic_damping' has a negative diagonal"),
        (
            {"hull_strip_x": text(np.arange(17))},
            "'hull_strip_x' has 17 numbers; strip_x and strip_area want as many, <= 16",
        ),
        ({"hull_strip_x": "0 1", "hull_strip_area": "1"}, "'hull_strip_area' has 1 numbers"),
        ({"screw_astern_loss": "1.2"}, "'screw_astern_loss' is 1.2; it is a share, at most 1"),
        ({"screw_power_limit": "50", "screw_torque_coefficients": "0 0"}, "'screw_power_limit' needs a positive K_Q0"),
    ],
)
def test_a_wrong_field_is_named(fields, expected):
    assert expected in refusal(model(fields))


@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ("hull_displaced_volume", "hull 'hull' lacks the numeric 'hull_displaced_volume'"),
        ("fin_stall_angle", "fin 'fin' lacks the numeric 'fin_stall_angle'"),
        ("screw_torque_coefficients", "propeller 'screw' lacks the numeric 'screw_torque_coefficients'"),
        (
            "hull_added_mass",
            "body 'hull' has the fields displaced_volume but no hull_added_mass or hull_area or hull_diam",
        ),
    ],
)
def test_a_missing_field_is_named(missing, expected):
    assert expected in refusal(model(without=(missing,)))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"joint": ""}, "hull 'hull' is not on a body with a free joint"),
        ({"joint": '<joint type="slide"/>'}, "hull 'hull' is not on a body with a free joint"),
        (
            {"joint": "", "without": ("hull_added_mass", "hull_displaced_volume")},
            "fin 'fin' is not on a body with a free",
        ),
        ({"hull_joint": "<joint/>"}, "hull 'hull' is not on a body with a free joint (hulls must be fixed to it)"),
        ({"shaft": ""}, "propeller 'screw' needs a shaft: one hinge joint about its x axis"),
        ({"shaft": '<joint type="ball"/>'}, "propeller 'screw' needs a shaft"),
        ({"size": 'nuser_body="10" nuserdata="19"'}, f"hydrodynamics need <size nuser_body='{RECORD}'>, not 10"),
        ({"size": f'nuser_body="{RECORD}"'}, f"1 vehicles need <size nuserdata='{fluid.WATER}'>, not 0"),
        ({"option": 'density="1000"'}, "option density and viscosity must be 0"),
        ({"option": 'viscosity="0.001"'}, "option density and viscosity must be 0"),
    ],
)
def test_a_model_that_cannot_carry_hydrodynamics_is_refused(change, expected):
    assert expected in refusal(model(**change))


def test_the_sleep_flag_is_refused():
    m = model()
    m.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    assert refusal(m).startswith("the sleep flag must be off")


@pytest.mark.parametrize(
    "shaft", ['axis="0 1 0"', 'axis="-1 0 0"', 'type="slide" axis="1 0 0"'], ids=["across", "backwards", "slide"]
)
def test_a_shaft_that_is_not_a_hinge_about_x_is_refused(shaft):
    """Its rate would be taken for revolutions about the axis of thrust, positive ahead."""
    assert refusal(model(shaft=f"<joint {shaft}/>")).startswith(
        "propeller 'screw' needs a shaft: one hinge joint about its x axis"
    )


def test_a_body_that_mujoco_finds_simple_is_refused():
    def lone(centre):
        return mujoco.MjModel.from_xml_string(
            f'<mujoco><size nuser_body="{RECORD}" nuserdata="{fluid.WATER}"/><worldbody><body name="hull"><freejoint/>'
            f'<inertial pos="{centre}" mass="1" diaginertia="1 1 1"/></body></worldbody><custom>'
            f'<numeric name="hull_added_mass" data="{text(ADDED)}"/><numeric name="hull_displaced_volume" data="0"/>'
            "</custom></mujoco>"
        )

    assert refusal(lone("0 0 0")).startswith("hull 'hull': MuJoCo keeps only the diagonal inertia of a body without")
    assert hydrodynamics.equip(lone("0 0 0.001")) == {"hull": 0}


@pytest.mark.parametrize("density", [0.0, -1.0, float("nan"), float("inf")])
def test_water_has_a_density(density):
    assert refusal(model(), density).startswith("water density is ")


def test_constraint_weights_are_the_inverse_of_the_summed_inertia():
    m = model()
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    dry = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, data, dry)
    hydrodynamics.equip(m)
    total = dry.copy()
    total[:6, :6] += flip_matrix(ADDED)  # at the origin and level the Jacobian is the identity
    inverse = np.linalg.inv(total)
    expected = [*[inverse.diagonal()[:3].mean()] * 3, *[inverse.diagonal()[3:6].mean()] * 3, inverse[6, 6]]
    assert m.dof_invweight0 == pytest.approx(expected, rel=1e-12)  # rounding


def test_remus100_is_described_as_published():
    root = library.vehicle("remus100").root
    root.find("body", "hull").add("freejoint")
    m = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    found = {body.name: body for body in hydrodynamics.bodies(m)}
    hull = found["hull"].fields
    assert hull["added_mass"].diagonal().tolist() == [0.839, 29.44, 29.44, 0.0336, 3.426, 3.426]
    # A spheroid of 0.8 m and 0.095 m half axes in water of 1026 kg/m3, which the vehicle weighs.
    assert hull["displaced_volume"][0] == pytest.approx(4 / 3 * np.pi * 0.8 * 0.095**2, rel=1e-4)
    assert m.body_subtreemass[1] == pytest.approx(1026.0 * hull["displaced_volume"][0], rel=2e-6)  # printed digits
    assert sorted(body.kind for body in found.values()) == ["fin"] * 8 + ["hull", "propeller"]
