"""Contact with a dock's panels as springs and dampers in SI units."""

import math

import mujoco

from auvsim.base.errors import InputError

IMPEDANCE = 0.05  # MuJoCo's d: the smaller, the nearer is a contact to a spring that knows of no other force
RESOLUTION = 0.06  # longest step of a contact, in radians of the vehicle's oscillation on the spring
MOST_SUBSTEPS = 20  # of a physics step, in contact


def soften(model: mujoco.MjModel, structure: str, vehicles: tuple[str, ...], stiffness: float, damping: float) -> int:
    """Gives the panels of a structure a stiffness and a damping, by what a vehicle's hull weighs in a contact.

    Returns in how many steps a physics step is to be made where the panels may be touched. A contact is first seen up
    to a step after it has begun, by then deeper by speed times step: at 100 Hz, that spring force is a quarter of the
    peak of a damped contact, which comes at its very beginning.

    MuJoCo takes the reference acceleration -(b v + k r) / d over A + A' (1 - d) / d, A the inverse mass that the
    contact feels and A' the hull's mean one, added mass included. With b = B A' and k = K A' that is the force
    (K r + B v) / (1 - d + d A / A'): right to a tenth with d = 0.05, at a nose too. Friction cones are elliptic, since
    each edge of a pyramid would be a spring of its own. Of several vehicles the first one counts.

    Args:
        model: compiled, with its hydrodynamics.
        structure: instance name.
        vehicles: instance names.
        stiffness: of a panel where it is touched [N/m].
        damping: likewise [N s/m].

    Raises:
        InputError: the physics step is too long for such a contact.
    """
    inverse_mass = float(model.body_invweight0[model.body(f"{vehicles[0]}/hull").id, 0])
    step = RESOLUTION / max((stiffness * inverse_mass) ** 0.5, damping * inverse_mass)
    substeps = math.ceil(model.opt.timestep / step - 1e-9)
    if substeps > MOST_SUBSTEPS:
        raise InputError(
            f"rates.physics: {1.0 / model.opt.timestep:g} Hz is too slow for the panels of '{structure}'; at least "
            f"{math.ceil(1.0 / (MOST_SUBSTEPS * step))} Hz"
        )
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    root = model.body(f"{structure}/").id
    for geom in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[geom]] != root:
            continue
        model.geom_solref[geom] = -stiffness * inverse_mass, -damping * inverse_mass
        model.geom_solimp[geom, :2] = IMPEDANCE
    return substeps
