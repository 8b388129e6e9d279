"""Missions of a user's own whose class declares something wrong, one fault each."""

from typing import ClassVar

from auvsim.control.controller import Setpoints
from auvsim.data.variables import Variable
from auvsim.missions.mission import Metric, Mission


class Right(Mission):
    """Straight ahead; what it declares is right."""

    phases = ("ahead", "done")
    variables: ClassVar = {"mood": Variable((), "float64", "1", "of the mission")}
    columns: ClassVar = {"calm": Metric("bool", "1", "whether it was calm")}

    def update(self, now):
        """Ahead at 20 m."""
        return Setpoints(0.0, 20.0, 1.0)

    def row(self):
        """The mood."""
        return (1.0,)

    @classmethod
    def metrics(cls, log):
        """Always calm."""
        return {"calm": True}


def _spoiled(name: str, **changes) -> type[Right]:
    return type(name, (Right,), changes)


PhasesText = _spoiled("PhasesText", phases="ahead")
PhasesEmpty = _spoiled("PhasesEmpty", phases=())
PhasesTwice = _spoiled("PhasesTwice", phases=("ahead", "ahead"))
PhasesNumbers = _spoiled("PhasesNumbers", phases=(1, 2))
VariablesList = _spoiled("VariablesList", variables=["mood"])
VariablesText = _spoiled("VariablesText", variables={"mood": "float64"})
VariablesName = _spoiled("VariablesName", variables={"a/b": Right.variables["mood"]})
VariablesTaken = _spoiled("VariablesTaken", variables={"phase": Right.variables["mood"]})
VariablesType = _spoiled("VariablesType", variables={"mood": Variable((), "float16", "1", "of it")})
VariablesSize = _spoiled("VariablesSize", variables={"mood": Variable(("moods",), "float64", "1", "of it")})
AftermathText = _spoiled("AftermathText", aftermath="2 s")
AftermathNegative = _spoiled("AftermathNegative", aftermath=-1.0)
AftermathNan = _spoiled("AftermathNan", aftermath=float("nan"))
ColumnsList = _spoiled("ColumnsList", columns=["calm"])
ColumnsText = _spoiled("ColumnsText", columns={"calm": "bool"})
ColumnsShort = _spoiled("ColumnsShort", columns={"calm": ("bool", "1")})
MetricsNone = _spoiled("MetricsNone", metrics=None)


class DockText(Right):
    """Its dock is no place."""

    def __init__(self, setup) -> None:
        super().__init__(setup)
        self.dock = "dock"


class EventsTuple(Right):
    """Its events cannot be appended to."""

    def __init__(self, setup) -> None:
        super().__init__(setup)
        self.events = ()


def _measures(name: str, found) -> type[Right]:
    def metrics(cls, log):
        if isinstance(found, Exception):
            raise found
        return found

    return type(name, (Right,), {"metrics": classmethod(metrics)})


GivesNothing = _measures("GivesNothing", None)
GivesList = _measures("GivesList", [1.0])
GivesObject = _measures("GivesObject", {"calm": object()})
GivesStatus = _measures("GivesStatus", {"calm": True, "status": "fine"})
GivesEstimate = _measures("GivesEstimate", {"calm": True, "estimate": 3})
Raises = _measures("Raises", ZeroDivisionError("of its own"))
