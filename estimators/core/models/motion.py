"""How a vehicle moves, written once in CasADi, with currents, input errors and sensor errors by composition.

motion = with_input_error(with_current(unicycle()), "speed", "scale")
process = MotionProcess(motion, {"north": 1e-4, "east": 1e-4}, input_noise={"turn_rate": 1e-4})
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca

from estimators.core.errors import ParameterError
from estimators.core.states import StateSpace

Symbols = Mapping[str, ca.SX]  # by name of state or input


@dataclass(frozen=True, slots=True)
class Motion:
    """States, inputs and their rates of change."""

    name: str
    space: StateSpace
    inputs: tuple[str, ...]
    rates: Callable[[Symbols, Symbols], Symbols]  # (states, inputs) -> d/dt by name; those not named are constant


def unicycle() -> Motion:
    """A vehicle that goes where it points: north, east [m], heading [rad]; speed [m/s] and turn rate [rad/s] given."""

    def rates(x: Symbols, u: Symbols) -> Symbols:
        return {
            "north": u["speed"] * ca.cos(x["heading"]),
            "east": u["speed"] * ca.sin(x["heading"]),
            "heading": u["turn_rate"],
        }

    space = StateSpace({"north": "m", "east": "m", "heading": "rad"}, ("heading",))
    return Motion("unicycle", space, ("speed", "turn_rate"), rates)


def dead_reckoning(heading: Literal["given", "state"] = "state") -> Motion:
    """Dead reckoning by DVL and compass: position [m], heading [rad]; forward and starboard speed [m/s] given.

    The heading is a state with the turn rate given (a gyro), or given itself (a compass that is trusted).
    """
    given = heading == "given"

    def rates(x: Symbols, u: Symbols) -> Symbols:
        psi = u["heading"] if given else x["heading"]
        north = ca.cos(psi) * u["forward"] - ca.sin(psi) * u["starboard"]
        east = ca.sin(psi) * u["forward"] + ca.cos(psi) * u["starboard"]
        return {"north": north, "east": east} if given else {"north": north, "east": east, "heading": u["turn_rate"]}

    units = {"north": "m", "east": "m"}
    space = StateSpace(units) if given else StateSpace({**units, "heading": "rad"}, ("heading",))
    return Motion(
        f"dead_reckoning_{heading}", space, ("forward", "starboard", "heading" if given else "turn_rate"), rates
    )


def constant_velocity(turning: bool = False) -> Motion:
    """A vehicle of which only measurements tell: its velocity is a random walk.

    Position [m] and velocity over ground, north and east [m/s]. With `turning` position, heading [rad], surge and sway
    through the water [m/s] and yaw rate [rad/s], in the order of the planar vehicle.
    """
    if not turning:
        units = {"north": "m", "east": "m", "velocity_north": "m/s", "velocity_east": "m/s"}
        return Motion(
            "constant_velocity",
            StateSpace(units),
            (),
            lambda x, u: {"north": x["velocity_north"], "east": x["velocity_east"]},
        )

    def rates(x: Symbols, u: Symbols) -> Symbols:
        c, s = ca.cos(x["heading"]), ca.sin(x["heading"])
        north, east = c * x["surge"] - s * x["sway"], s * x["surge"] + c * x["sway"]
        return {"north": north, "east": east, "heading": x["yaw_rate"]}

    units = {"north": "m", "east": "m", "heading": "rad", "surge": "m/s", "sway": "m/s", "yaw_rate": "rad/s"}
    return Motion("constant_body_velocity", StateSpace(units, ("heading",)), (), rates)


def with_depth(motion: Motion) -> Motion:
    """The motion with depth [m] and its rate of change [m/s] as states."""
    space = motion.space.extended("depth", "m").extended("depth_rate", "m/s")
    return replace(
        motion,
        name=f"{motion.name}_depth",
        space=space,
        rates=lambda x, u: {**motion.rates(x, u), "depth": x["depth_rate"]},
    )


def with_current(motion: Motion) -> Motion:
    """The motion in a current, a random walk [m/s] that is added to the velocity through the water."""
    space = motion.space.extended("current_north", "m/s").extended("current_east", "m/s")

    def rates(x: Symbols, u: Symbols) -> Symbols:
        still = motion.rates(x, u)
        drift = {"north": still["north"] + x["current_north"], "east": still["east"] + x["current_east"]}
        return {**still, **drift}

    return replace(motion, name=f"{motion.name}_current", space=space, rates=rates)


def with_error(motion: Motion, name: str, unit: str, time_constant: float | None = None) -> Motion:
    """The motion with one more state that only sensors show: a bias, a scale, a lag, the depth of the floor.

    A random walk, constant if its noise is zero; with a `time_constant` [s] it decays (a Gauss-Markov process).
    """
    if time_constant is not None and not time_constant > 0.0:
        raise ParameterError(f"time constant {time_constant} s of '{name}' must be above 0")
    space = motion.space.extended(name, unit)
    if time_constant is None:
        return replace(motion, name=f"{motion.name}_{name}", space=space)
    decay = 1.0 / time_constant

    def rates(x: Symbols, u: Symbols) -> Symbols:
        return {**motion.rates(x, u), name: -decay * x[name]}

    return replace(motion, name=f"{motion.name}_{name}", space=space, rates=rates)


def with_input_error(motion: Motion, given: str, kind: Literal["bias", "scale"]) -> Motion:
    """The motion with the error of an input as a state: what is given is (1 + scale) true + bias.

    The state is called `<input>_bias`, in the input's unit, or `<input>_scale`.

    Raises:
        ParameterError: There is no such input.
    """
    if given not in motion.inputs:
        raise ParameterError(f"no input '{given}'; there are {', '.join(motion.inputs) or 'none'}")
    name = f"{given}_{kind}"
    space = motion.space.extended(name, "1" if kind == "scale" else "input")

    def rates(x: Symbols, u: Symbols) -> Symbols:
        true = u[given] / (1.0 + x[name]) if kind == "scale" else u[given] - x[name]
        return motion.rates(x, {**u, given: true})

    return replace(motion, name=f"{motion.name}_{name}", space=space, rates=rates)
