"""A Foxglove layout of a log: the scene, the map, motion, sensors and actuators of each vehicle, and events."""

from collections.abc import Collection, Sequence
from typing import Any

COLOURS = ("#1f5fa8", "#d95f02", "#2f8f4e", "#b03060", "#6a51a3", "#777777")


def layout(vehicles: Sequence[str], topics: Collection[str]) -> dict[str, Any]:
    """The layout as Foxglove imports it: panels by name, and how they lie beside each other.

    Args:
        vehicles: Names of the vehicles, each with a tab of its own.
        topics: That there are; panels show no others.
    """
    panels: dict[str, Any] = {
        "3D!scene": {
            "followTf": f"{vehicles[0]}/base_link" if vehicles else "map",
            "followMode": "follow-position",
            "scene": {},
            "topics": {t: {"visible": True} for t in sorted(topics) if t.endswith(("/odometry", "/usbl/position"))},
            "layers": {"grid": {"layerId": "foxglove.Grid", "visible": True, "size": 500, "divisions": 50}},
        },
        "RosOut!events": {"searchTerms": [], "minLogLevel": 1, "topicToRender": "/rosout"},
    }
    satellite = sorted(topic for topic in topics if topic.endswith("/fix"))
    if satellite:
        panels["map!map"] = {"disabledTopics": [], "layer": "map"}
    tabs = []
    for vehicle in vehicles:
        plots = _plots(vehicle, topics)
        panels |= plots
        tabs.append({"title": vehicle, "layout": _stack(list(plots), "column")})
    panels["Tab!vehicles"] = {"activeTabIdx": 0, "tabs": tabs}
    left = [name for name in panels if name.startswith(("3D", "map", "RosOut"))]
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": _stack(left, "column"), "second": "Tab!vehicles",
                   "splitPercentage": 45},
    }  # fmt: skip


def _plots(vehicle: str, topics: Collection[str]) -> dict[str, Any]:
    """Plots of one vehicle, those of topics that there are."""
    at = f"/{vehicle}"
    wanted = {
        "position": [
            (f"{at}/{kind}/odometry", f"pose.pose.position.{axis}") for axis in "xyz" for kind in ("truth", "estimate")
        ],
        "speed": [
            (f"{at}/truth/odometry", "twist.twist.linear.x"), (f"{at}/estimate/odometry", "twist.twist.linear.x"),
            (f"{at}/dvl/bottom", "velocity.x"), (f"{at}/dvl/water", "velocity.x"),
        ],
        "yaw rate": [
            (f"{at}/truth/odometry", "twist.twist.angular.z"), (f"{at}/gyro", "angular_velocity.z"),
            (f"{at}/estimate/odometry", "twist.twist.angular.z"),
        ],
        "actuation": [(f"{at}/actuation", f"position[{k}]") for k in range(2)]
        + [(f"{at}/command", "position[0]"), (f"{at}/actuation", "velocity[2]")],
        "pressure": [(f"{at}/depth", "fluid_pressure")],
    }  # fmt: skip
    return {
        f"Plot!{vehicle} {name}": {
            "title": f"{vehicle}: {name}",
            "paths": [
                {"value": f"{topic}.{field}", "enabled": True, "timestampMethod": "headerStamp", "color": colour}
                for (topic, field), colour in zip(there, COLOURS, strict=False)
            ],
            "showLegend": True,
            "legendDisplay": "floating",
            "isSynced": True,
            "xAxisVal": "timestamp",
        }
        for name, paths in wanted.items()
        if (there := [(topic, field) for topic, field in paths if topic in topics])
    }


def _stack(names: Sequence[str], direction: str) -> Any:
    """Panels beside or under each other, of the same size."""
    if len(names) == 1:
        return names[0]
    share = 100.0 / len(names)
    return {"direction": direction, "first": names[0], "second": _stack(names[1:], direction), "splitPercentage": share}
