"""What a docking logs at each update, and the metrics that it is judged by."""

from collections.abc import Mapping

from auvsim.data.variables import Table, Variable
from auvsim.missions.mission import Metric

VARIABLES: Table = {
    "attempt": Variable((), "int8", "1", "number of the docking attempt, from 1"),
    "along_track": Variable((), "float64", "m", "estimated distance along the dock axis, < 0 before", "dock"),
    "cross_track": Variable((), "float64", "m", "estimated distance to starboard of the dock axis", "dock"),
    "below": Variable((), "float64", "m", "estimated distance below the dock axis", "dock"),
    "cross_deviation": Variable((), "float64", "m", "standard deviation of cross_track", "dock"),
    "axis": Variable((), "float64", "rad", "estimated course of the dock axis", "NED"),
}
COLUMNS: Mapping[str, Metric] = {
    "docked": Metric("bool", "1", "whether it docked"),
    "docked_first": Metric("bool", "1", "whether it docked on the first attempt"),
    "failure_reason": Metric("str", "", "timeout, aborted or diverged; none if docked"),
    "failure_text": Metric("str", "", "what the log says of it"),
    "attempts": Metric("int", "1", "attempts to dock"),
    "approaches": Metric("int", "1", "approaches begun, with those broken off early that count as no attempt"),
    "time": Metric("float", "s", "of docking, or of the end"),
    "miss_distance": Metric("float", "m", "of the nose from the dock's axis where it first enters, last attempt"),
    "cross_track": Metric("float", "m", "its part to starboard"),
    "vertical": Metric("float", "m", "its part downward"),
    "heading_error_deg": Metric("float", "deg", "heading less that of the dock, there"),
    "contact_impulse": Metric("float", "N s", "contact impulse, friction included, until the latch held"),
    "peak_contact_force": Metric(
        "float", "N", "largest contact force, friction included, until then; as uncertain as the panels' stiffness"
    ),
    "contacts": Metric(
        "int", "1", "separate contacts until then, 0.2 s apart or more, the last one in the dock included"
    ),
    "shaft_energy": Metric(
        "float", "J", "energy that the shaft gave to the propeller until the time of docking or the end"
    ),
    "way": Metric("float", "m", "through the water, until then"),
    "docked_aligned": Metric("bool", "1", "whether it docked and lies within the dock's own limit of its axis"),
    "final_along": Metric("float", "m", "of the nose behind the mouth, along the axis, at the end, if it docked"),
    "final_cross": Metric("float", "m", "of the nose to starboard of the axis, then"),
    "final_down": Metric("float", "m", "of the nose below the axis, then"),
    "final_angle_deg": Metric("float", "deg", "between the vehicle's axis and the dock's, then"),
}
