"""Contact with a dock's panels as springs and dampers in SI units."""

import mujoco

from auvsim.base.errors import InputError

IMPEDANCE = 0.05  # MuJoCo's d: the smaller, the nearer is a contact to a spring that knows of no other force


def soften(model: mujoco.MjModel, structure: str, vehicles: tuple[str, ...], stiffness: float, damping: float) -> None:
    """Gives the panels of a structure a stiffness and a damping, by what a vehicle's hull weighs in a contact.

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
        InputError: the step is too long for such a contact.
    """
    inverse_mass = float(model.body_invweight0[model.body(f"{vehicles[0]}/hull").id, 0])
    # A tenth of the period of the vehicle on the spring, and of the damping's time.
    step = min(0.5 / (stiffness * inverse_mass) ** 0.5, 0.5 / max(damping * inverse_mass, 1e-9))
    if model.opt.timestep > step:
        raise InputError(
            f"rates.physics: {1.0 / model.opt.timestep:g} Hz is too slow for the panels of '{structure}'; at least "
            f"{1.0 / step:.0f} Hz"
        )
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    root = model.body(f"{structure}/").id
    for geom in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[geom]] != root:
            continue
        model.geom_solref[geom] = -stiffness * inverse_mass, -damping * inverse_mass
        model.geom_solimp[geom, :2] = IMPEDANCE
