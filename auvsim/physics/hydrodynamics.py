"""The hydrodynamic coefficients of a vehicle: read from its MJCF, checked, and put where the fluid callback finds them.

A body `hull` is described by `<custom><numeric>` fields named `hull_<field>`, in SNAME form and forward-starboard-down
axes about the body's origin, which is its centre of buoyancy; matrices are Fossen's positive M_A and D. Fins and
propellers are bodies of their own with their own fields; `fin_<field>` and `thruster_<field>` hold for all of a vehicle
that do not give their own. PyMJCF prefixes bodies and fields alike when a vehicle is
attached.
"""

import re
from functools import lru_cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array, flip_matrix
from auvsim.base.settings import OTHERWISE
from auvsim.physics import fluid, thrusters
from auvsim.physics.forces import (
    BRAKE,
    CHANNEL,
    DENSITY,
    DERIVED,
    FIN,
    FIN_KIND,
    HULL,
    HULL_KIND,
    KIND,
    PROPELLER,
    PROPELLER_KIND,
    RECORD,
    SLOT,
    STRIPS,
    THRUSTER,
    THRUSTER_KIND,
)
from auvsim.physics.strips import submerged_strips

SEA_WATER = 1026.0  # density [kg/m3], as the REMUS-100 reference has it
BRAKE_TIME = 0.02  # time in which a shaft faster than its motor's limits slows down [s]

_KINDS = {"hull": (HULL_KIND, HULL), "fin": (FIN_KIND, FIN), "propeller": (PROPELLER_KIND, PROPELLER)}
_KINDS |= {"thruster": (THRUSTER_KIND, THRUSTER)}
_REQUIRED = {
    "hull": ("added_mass", "displaced_volume"),
    "fin": ("area", "lift_slope", "stall_angle"),
    "propeller": ("diameter", "thrust_coefficients", "torque_coefficients"),
    "thruster": ("thrust", "size"),
}
_MATRICES = ("added_mass", "linear_damping", "quadratic_damping")
_SIGNED = ("body_lift_x", "reaction", "strip_x", "thrust_coefficients", "torque_coefficients", *_MATRICES)


_COMMON = re.compile(r"(?P<prefix>.*/)?(?P<kind>fin|thruster)_(?P<field>\w+)")  # of all bodies of a kind, in one line


class Body(NamedTuple):
    """One body with hydrodynamic fields."""

    index: int
    name: str
    kind: str  # hull, fin, propeller or thruster
    fields: dict[str, Array]


def bodies(model: mujoco.MjModel) -> list[Body]:
    """Finds and checks the bodies that carry hydrodynamic fields.

    Raises:
        InputError: a field names no body, is unknown, has the wrong count, or is not finite or negative.
    """
    names = [model.body(i).name for i in range(model.nbody)]
    found: dict[str, dict[str, Array]] = {}
    common: dict[tuple[str, str], dict[str, Array]] = {}  # fields of all fins or thrusters of a vehicle, by its prefix
    known = {field for _, table in _KINDS.values() for field in table}
    for i in range(model.nnumeric):
        numeric = model.numeric(i)
        owners = [name for name in names if name and numeric.name.startswith(f"{name}_")]
        if (
            not owners
            and (of_kind := _COMMON.fullmatch(numeric.name))
            and of_kind["field"] in _KINDS[of_kind["kind"]][1]
        ):
            fields = common.setdefault((of_kind["prefix"] or "", of_kind["kind"]), {})
            fields[of_kind["field"]] = np.array(numeric.data, dtype=float)
            continue
        if not owners:
            if any(numeric.name.endswith(f"_{field}") for field in known):
                raise InputError(f"numeric '{numeric.name}' names no body; bodies: {', '.join(filter(None, names))}")
            continue
        owner = max(owners, key=len)
        found.setdefault(owner, {})[numeric.name[len(owner) + 1 :]] = np.array(numeric.data, dtype=float)
    for name, fields in found.items():
        prefix = name[: name.rfind("/") + 1]
        for kind in ("fin", "thruster"):
            if fields.keys() <= _KINDS[kind][1].keys():
                found[name] = common.get((prefix, kind), {}) | fields
    return [_check(names.index(name), name, fields) for name, fields in found.items()]


def _check(index: int, name: str, fields: dict[str, Array]) -> Body:
    kind = next((kind for kind, required in _REQUIRED.items() if required[0] in fields), None)
    if kind is None:
        wanted = " or ".join(f"{name}_{required[0]}" for required in _REQUIRED.values())
        raise InputError(f"body '{name}' has the fields {', '.join(fields)} but no {wanted}")
    table = _KINDS[kind][1]
    for field in _REQUIRED[kind]:
        if field not in fields:
            raise InputError(f"{kind} '{name}' lacks the numeric '{name}_{field}'")
    for field, value in fields.items():
        if field not in table:
            raise InputError(f"{kind} '{name}' has no field '{field}'; there are {', '.join(table)}")
        count = table[field][1]
        if field.startswith("strip_"):
            if value.size > STRIPS or value.size != fields.get("strip_x", value).size:
                raise InputError(
                    f"'{name}_{field}' has {value.size} numbers; strip_x and strip_area want as many, <= {STRIPS}"
                )
        elif value.size != count:
            raise InputError(f"'{name}_{field}' has {value.size} numbers instead of {count}")
        if not np.all(np.isfinite(value)):
            raise InputError(f"'{name}_{field}' is not finite")
        if np.abs(value).max(initial=0.0) > OTHERWISE:
            raise InputError(f"'{name}_{field}' has {np.abs(value).max():g}, more than {OTHERWISE:g}")
        if field not in _SIGNED and np.any(value < 0):
            raise InputError(f"'{name}_{field}' is negative: {value.min():g}")
        if field in _MATRICES:
            fields[field] = value.reshape(6, 6)
    for field in _MATRICES[: 2 if kind == "hull" else 0]:
        matrix = fields.get(field, np.zeros((6, 6)))
        if field == "added_mass" and not np.allclose(matrix, matrix.T, rtol=0, atol=1e-9 * np.abs(matrix).max()):
            raise InputError(f"'{name}_{field}' is not symmetric")
        if np.linalg.eigvalsh(matrix + matrix.T).min() < -1e-9 * max(1.0, np.abs(matrix).max()):
            raise InputError(f"'{name}_{field}' is not positive semidefinite (M_A and D are positive here)")
    if kind == "thruster" and fields.get("dead_band", np.zeros(1))[0] >= 1.0:
        raise InputError(f"'{name}_dead_band' is {fields['dead_band'][0]:g}; full command is 1")
    if fields.get("astern_loss", np.zeros(1))[0] > 1.0:
        raise InputError(f"'{name}_astern_loss' is {fields['astern_loss'][0]:g}; it is a share, at most 1")
    for field in ("torque_limit", "power_limit"):
        if field in fields and fields[field][0] > 0.0 >= fields["torque_coefficients"][0]:
            raise InputError(f"'{name}_{field}' needs a positive K_Q0 in '{name}_torque_coefficients'")
    if np.any(fields.get("quadratic_damping", np.zeros((6, 6))).diagonal() < 0):
        raise InputError(f"'{name}_quadratic_damping' has a negative diagonal (D is positive here)")
    return Body(index, name, kind, fields)


def _record(body: Body, slot: int, density: float) -> Array:
    """The numbers of a body as the compiled code reads them, in MuJoCo's axes."""
    record = np.zeros(RECORD)
    kind, table = _KINDS[body.kind]
    record[[KIND, SLOT, DENSITY]] = kind, slot, density
    for field, value in body.fields.items():
        value = flip_matrix(value) if field in _MATRICES else value
        record[table[field][0] : table[field][0] + value.size] = value.ravel()
    if body.kind == "hull":
        for field, value in submerged_strips(body.fields).items():
            at = (HULL | DERIVED)[field][0]
            record[at : at + value.size] = value
    return record


@lru_cache(maxsize=16)
def propeller_of(text: str, density: float) -> Array | None:
    """The numbers of the propeller of a vehicle alone, as `forces.propeller_force` reads them; None if it has none.

    Args:
        text: Its MJCF.
        density: Of the water [kg/m3].

    Raises:
        InputError: As `bodies`.
    """
    found = bodies(mujoco.MjModel.from_xml_string(text))
    return next((_record(body, 0, density) for body in found if body.kind == "propeller"), None)


def equip(model: mujoco.MjModel, density: float = SEA_WATER) -> dict[str, int]:
    """Puts the coefficients of all vehicles into a compiled model and the callback into MuJoCo.

    Constraint weights (`body_invweight0`, `dof_invweight0`) are recomputed from the summed inertia, so that contacts
    and welds act on the body with its added mass; call again after `mj_setConst`.

    Args:
        model: changed in place.
        density: density of the water [kg/m3].

    Returns:
        For each vehicle's free body, by name, the offset of its water slot in `mjData.userdata`.

    Raises:
        InputError: a field is wrong, or the model cannot carry hydrodynamics.
    """
    if not np.isfinite(density) or density <= 0:
        raise InputError(f"water density is {density:g} kg/m3; it must be positive")
    elements = bodies(model)
    slots: dict[str, int] = {}
    if not elements:
        return slots
    _check_model(model, elements)
    for body in elements:
        base = model.body_rootid[body.index]
        slot = slots.setdefault(model.body(base).name, fluid.WATER * len(slots))
        model.body_user[body.index, :RECORD] = _record(body, slot, density)
        if body.kind == "propeller":
            armature = model.dof_armature[model.body_dofadr[body.index]]
            model.body_user[body.index, BRAKE] = armature / BRAKE_TIME
        elif body.kind == "thruster":
            model.body_user[body.index, CHANNEL] = thrusters.channel(model, body.name)
    if model.nuserdata < fluid.WATER * len(slots):
        raise InputError(
            f"{len(slots)} vehicles need <size nuserdata='{fluid.WATER * len(slots)}'>, not {model.nuserdata}"
        )
    fluid.install()
    _weigh_constraints(model)
    return slots


def _check_model(model: mujoco.MjModel, elements: list[Body]) -> None:
    if model.nuser_body < RECORD:
        raise InputError(f"hydrodynamics need <size nuser_body='{RECORD}'>, not {model.nuser_body}")
    if model.opt.density or model.opt.viscosity:
        raise InputError("option density and viscosity must be 0: MuJoCo's own fluid model would act as well")
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP):
        raise InputError(
            "the sleep flag must be off: the inertia of a sleeping body is not rebuilt, so added mass would accumulate"
        )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for body in elements:
        base, weld = model.body_rootid[body.index], model.body_weldid[body.index]
        free = model.body_dofnum[base] == 6 and model.jnt_type[model.body_jntadr[base]] == mujoco.mjtJoint.mjJNT_FREE
        if not free or (body.kind == "hull" and weld != base):
            raise InputError(
                f"{body.kind} '{body.name}' is not on a body with a free joint (hulls must be fixed to it)"
            )
        if body.kind == "propeller" and not _on_a_shaft(model, body.index):
            raise InputError(f"propeller '{body.name}' needs a shaft: one hinge joint about its x axis")
        if body.kind == "thruster":
            thrusters.check_place(model, data, body.index, body.fields["size"][0])
        if body.kind == "hull" and model.body_simple[base]:
            raise InputError(
                f"hull '{body.name}': MuJoCo keeps only the diagonal inertia of a body without children whose centre of"
                " mass is its origin; move the centre of mass or add a hinged body"
            )


def _on_a_shaft(model: mujoco.MjModel, body: int) -> bool:
    joint = model.body_jntadr[body]
    hinged = model.body_jntnum[body] == 1 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    return bool(hinged and model.jnt_axis[joint, 0] > 1.0 - 1e-9)


def _weigh_constraints(model: mujoco.MjModel) -> None:
    """Recomputes `body_invweight0` and `dof_invweight0` as `mj_setConst` does, with the added mass in the inertia."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inverse = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    if not np.all(np.isfinite(inverse)) or np.linalg.eigvalsh(inverse).min() <= 0:
        raise InputError("rigid-body plus added mass is not positive definite")
    jacobian: Any = np.zeros((6, model.nv))
    for body in range(1, model.nbody):
        if model.body_weldid[body] == 0:
            continue
        mujoco.mj_jacBodyCom(model, data, jacobian[:3], jacobian[3:], body)
        weight = np.einsum("ij,jk,ik->i", jacobian, inverse, jacobian)
        model.body_invweight0[body] = max(weight[:3].mean(), mujoco.mjMINVAL), max(weight[3:].mean(), mujoco.mjMINVAL)
    diagonal = inverse.diagonal()
    for joint in range(model.njnt):
        at, kind = model.jnt_dofadr[joint], model.jnt_type[joint]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            model.dof_invweight0[at : at + 3] = diagonal[at : at + 3].mean()
            model.dof_invweight0[at + 3 : at + 6] = diagonal[at + 3 : at + 6].mean()
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            model.dof_invweight0[at : at + 3] = diagonal[at : at + 3].mean()
        else:
            model.dof_invweight0[at] = diagonal[at]
