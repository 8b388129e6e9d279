"""The log format as Markdown, for the documentation."""

from collections.abc import Mapping

from auvsim.data.attributes import RUN_ATTRIBUTES, STRUCTURE_ATTRIBUTES, VEHICLE_ATTRIBUTES, AttributeSpec
from auvsim.data.variables import OPTIONAL_TABLES, READING, RECEIVED, ROOT_TABLES, SIZES, VEHICLE_TABLES, Table

INTRODUCTION = """\
# Log format 3

A run leaves one NetCDF-4 file, which is whole or absent. Its groups are nested: `vehicles/<name>/truth`,
`vehicles/<name>/sensors/<sensor>`, `structures/<name>`, `network/messages`, `event`. Every variable has `time` as its
first axis and describes itself by the attributes `units`, `long_name`, `frame` (where one applies), `labels` (names
along its last axis, separated by commas) and `flag_values` with `flag_meanings` (what integers mean).

```python
import xarray

truth = xarray.open_dataset("trial.nc", group="vehicles/remus100/truth")

from auvsim.data.log import read

vehicle = read("trial.nc").vehicle()  # of the only vehicle; vehicle("auv_1") of one among several
vehicle["truth"]["position"], vehicle["compass"]["value"], vehicle.phases
```

Types: `category` is text from a small set, which the file holds as integers with the texts in the attribute
`categories`; `str` is free text. Logs of formats 1 and 2 are converted when they are read.
"""


def table_markdown(tables: Mapping[str, Table] | None = None) -> str:
    """The log format as Markdown.

    Args:
        tables: More tables by heading, which follow the general ones: those of sensors, missions and actuations.
    """
    lines = [INTRODUCTION, "## Attributes"]
    lines += _attributes("Of the file", RUN_ATTRIBUTES)
    lines += _attributes("Of a vehicle, `vehicles/<name>`", VEHICLE_ATTRIBUTES)
    lines += _attributes("Of a structure, `structures/<name>`", STRUCTURE_ATTRIBUTES)
    lines += ["", "## Groups"]
    for name, table in VEHICLE_TABLES.items():
        lines += _table(f"Group `vehicles/<name>/{name}`{_MORE.get(name, '')}", table)
    lines += _table("Group `vehicles/<name>/sensors/<sensor>`, with `value` and the sensor's own variables", READING)
    lines += _table("Group `vehicles/<name>/received`, of a vehicle with a modem", RECEIVED)
    for name, table in ROOT_TABLES.items():
        lines += _table(f"Group `{name}`", table)
    for name, table in OPTIONAL_TABLES.items():
        lines += _table(f"Group `{name}`, which earlier logs lack", table)
    for heading, table in (tables or {}).items():
        lines += _table(heading, table)
    return "\n".join(lines)


_MORE = {
    "mission": ", with the mission's own variables",
    "command": ", with a variable for each demand of the vehicle's actuation",
}


def _attributes(heading: str, specs: Mapping[str, AttributeSpec]) -> list[str]:
    lines = ["", f"{heading}:", "", "| attribute | type | meaning |", "| --- | --- | --- |"]
    kinds = {str: "text", int: "integer", float: "number"}
    for name, spec in specs.items():
        lines.append(f"| {name} | {kinds[spec.types]}{'' if spec.required else ', optional'} | {spec.meaning} |")
    return lines


def _table(heading: str, table: Table) -> list[str]:
    lines = ["", f"{heading}:", "", "| variable | dimensions | type | units | frame | meaning |"]
    lines.append("| --- | --- | --- | --- | --- | --- |")
    for name, variable in table.items():
        sizes = [f"{d} ({SIZES[d]})" if d in SIZES else d for d in variable.dimensions]
        meaning = variable.long_name
        if variable.flags:
            meaning += ": " + ", ".join(f"{value} {flag}" for value, flag in enumerate(variable.flags))
        cells = (name, ", ".join(["time", *sizes]), variable.dtype, variable.units, variable.frame, meaning)
        lines.append(f"| {' | '.join(cells)} |")
    return lines
