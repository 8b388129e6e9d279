"""One vehicle's log as ROS 2 messages: truth and estimate as odometry, every sensor as its driver would publish it.

World frame `map`: east, north, up from the datum. Body frame `NAME/base_link`: forward, port, up. Rudder and planes
keep the log's signs (a positive rudder turns to starboard), as joints have axes of their own; the DVL's message is
forward, starboard, down by its own definition. Stamps are the simulated time at which a reading was true; messages are
recorded when they arrived, lost ones never. Variances are those of the sensors' data sheets, noise and bias together.
"""

from collections.abc import Iterator
from typing import Any

from auvsim.base.datum import Datum
from auvsim.data.log import VehicleLog
from auvsim.exchange import motion_messages, sensor_messages
from auvsim.exchange.ros_messages import Ros, Rows, Stream
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.sensor_settings import on_board


def streams(log: VehicleLog, plan: Scenario, datum: Datum | None) -> Iterator[Stream]:
    """All topics of a vehicle.

    Args:
        log: Of the vehicle.
        plan: The scenario of the run, for the sensors' data sheets.
        datum: Where the origin is; None: positions from elsewhere are poses in `map`, not satellite fixes.
    """
    ros, at = Ros(), f"/{log.name}"
    own = plan.vehicles[log.name]
    yield Stream(f"{at}/truth/odometry", "nav_msgs/msg/Odometry", motion_messages.truth(ros, log))
    yield Stream("/tf", "tf2_msgs/msg/TFMessage", motion_messages.transforms(ros, log))
    for name, rows in (
        ("current", motion_messages.current(ros, log)),
        ("velocity_through_water", motion_messages.through_water(ros, log)),
    ):
        yield Stream(f"{at}/truth/{name}", "geometry_msgs/msg/TwistStamped", rows)
    if datum is not None:
        yield Stream(f"{at}/truth/fix", "sensor_msgs/msg/NavSatFix", motion_messages.true_fixes(ros, log, datum))
    if "estimate" in log:
        gauge = own.sensors.depth
        rows = motion_messages.estimates(ros, log, gauge.noise**2 + gauge.bias**2)
        yield Stream(f"{at}/estimate/odometry", "nav_msgs/msg/Odometry", rows)
    if "command" in log:
        yield Stream(f"{at}/command", "sensor_msgs/msg/JointState", motion_messages.commands(ros, log))
    for name, settings in on_board(own.sensors):
        if name in log and name != "usbl":
            kind = getattr(settings, "kind", name)
            yield from sensor_messages.sensor(ros, log, name, kind, settings, plan, datum)
    if "usbl" in log and "compass" in log:
        yield from sensor_messages.usbl(ros, log, plan)


def events(log: Any) -> Stream:
    """The run's events, as nodes log them."""
    ros, rows = Ros(), log.groups.get("event", {"time": []})

    def messages() -> Rows:
        for k, t in enumerate(rows["time"]):
            yield t, t, ros.make(
                "rcl_interfaces/msg/Log",
                stamp=ros.time(t), level=20, name=str(rows["vehicle"][k]) or "run",
                msg=f"{rows['kind'][k]}: {rows['text'][k]}", file="", function="", line=0,
            )  # fmt: skip

    return Stream("/rosout", "rcl_interfaces/msg/Log", messages())
