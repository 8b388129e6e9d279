"""What a user's column means: its quantity by its name, its unit by its header or a mapping, and its sign.

Conventions: rudder positive to starboard (turns to starboard), heading clockwise from north, yaw rate clockwise seen
from above, sway to starboard, surge and sway through the water. A mapping file turns others into these.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from auvsim.base import yaml_text
from auvsim.base.errors import InputError, unknown_name
from auvsim.base.settings import Settings

_DEG = math.pi / 180.0
UNITS: dict[str, dict[str, float]] = {  # by kind of quantity; the first is SI, the one taken where none is given
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "angle": {"rad": 1.0, "deg": _DEG},
    "turning": {"rad/s": 1.0, "deg/s": _DEG, "deg/min": _DEG / 60.0},
    # Per cent of the largest stays what it is: a coefficient then counts by that.
    "shaft": {"rad/s": 1.0, "%": 1.0, "rpm": math.pi / 30.0, "rps": 2.0 * math.pi, "hz": 2.0 * math.pi, "deg/s": _DEG},
    "speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0},
    "length": {"m": 1.0, "cm": 1e-2, "km": 1e3, "nmi": 1852.0},
    "place": {"deg": 1.0, "rad": 1.0 / _DEG},  # of latitude and longitude, kept in degrees
    "text": {"": 1.0},
}
_SPELLINGS = {
    "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad", "sec": "s", "second": "s",
    "seconds": "s", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns", "minutes": "min", "hours": "h",
    "metre": "m", "metres": "m", "meter": "m", "meters": "m", "knot": "kn", "knots": "kn", "kts": "kn",
    "kt": "kn", "°/s": "deg/s", "degrees/s": "deg/s", "deg/sec": "deg/s", "m_s": "m/s", "mps": "m/s", "m s-1": "m/s",
    "m.s-1": "m/s", "rad_s": "rad/s", "rad s-1": "rad/s", "deg_s": "deg/s", "deg s-1": "deg/s", "dps": "deg/s",
    "rev/min": "rpm", "1/min": "rpm", "rev/s": "rps", "1/s": "rps", "cm_s": "cm/s", "degrees_north": "deg",
    "degrees_east": "deg", "radians/s": "rad/s",
}  # fmt: skip


class Quantity(NamedTuple):
    """A quantity that is understood."""

    kind: str  # of UNITS
    aliases: str  # names of columns it goes by, in lower case
    sensor: str = ""  # whose time column may be its own


QUANTITIES: dict[str, Quantity] = {
    "time": Quantity("time", "time t timestamp stamp seconds elapsed utc datetime date_time"),
    "rudder": Quantity("angle", "rudder rudder_angle delta delta_r rudder_feedback rudder_measured", "rudder fins"),
    "rudder_command": Quantity("angle", "rudder_command rudder_cmd commanded_rudder delta_cmd", "rudder command"),
    "shaft_speed": Quantity(
        "shaft", "shaft_speed shaft n rpm propeller propeller_speed prop prop_speed thruster", "shaft propeller"
    ),
    "shaft_port": Quantity(
        "shaft",
        "shaft_port port_shaft n_port port_n port_rpm rpm_port thruster_port port_thruster shaft_left n_left "
        "left_rpm rpm_left thruster_left left_thruster port_propeller propeller_port",
        "shaft propeller",
    ),
    "shaft_starboard": Quantity(
        "shaft",
        "shaft_starboard starboard_shaft n_starboard starboard_n starboard_rpm rpm_starboard n_stbd stbd_rpm "
        "rpm_stbd thruster_starboard starboard_thruster shaft_right n_right right_rpm rpm_right thruster_right "
        "right_thruster starboard_propeller propeller_starboard",
        "shaft propeller",
    ),
    "side_thruster": Quantity("shaft", "side_thruster bow_thruster tunnel_thruster lateral_thruster thruster_bow", ""),
    "heading": Quantity("angle", "heading psi yaw compass hdg compass_heading yaw_angle", "compass imu ahrs"),
    "yaw_rate": Quantity("turning", "yaw_rate r gyro gyro_z heading_rate rate_of_turn rot yawrate", "gyro imu ahrs"),
    "surge": Quantity("speed", "surge u stw speed_through_water water_surge dvl_water_u u_water", "dvl log"),
    "sway": Quantity("speed", "sway v water_sway dvl_water_v v_water", "dvl log"),
    "ground_surge": Quantity("speed", "ground_surge dvl_u u_ground dvl_bottom_u bottom_surge", "dvl"),
    "ground_sway": Quantity("speed", "ground_sway dvl_v v_ground dvl_bottom_v bottom_sway", "dvl"),
    "velocity_north": Quantity("speed", "velocity_north v_north vel_north vn", "gps dvl"),
    "velocity_east": Quantity("speed", "velocity_east v_east vel_east ve", "gps dvl"),
    "north": Quantity("length", "north northing pos_north position_north", "position usbl gps"),
    "east": Quantity("length", "east easting pos_east position_east", "position usbl gps"),
    "latitude": Quantity("place", "latitude lat", "position gps"),
    "longitude": Quantity("place", "longitude lon long", "position gps"),
    "pitch": Quantity("angle", "pitch theta pitch_angle", "compass imu ahrs"),
    "current_north": Quantity("speed", "current_north current_n", "current"),
    "current_east": Quantity("speed", "current_east current_e", "current"),
    "wind_forward": Quantity("speed", "wind_forward apparent_wind_forward", "wind anemometer"),
    "wind_starboard": Quantity("speed", "wind_starboard apparent_wind_starboard", "wind anemometer"),
    "wind_speed": Quantity("speed", "wind_speed apparent_wind_speed aws", "wind anemometer"),
    "wind_from": Quantity("angle", "wind_from apparent_wind_angle awa", "wind anemometer"),
    "manoeuvre": Quantity("text", "manoeuvre maneuver manoeuver run segment test trial"),
    "namespace": Quantity("text", ""),  # of the topics of a bag that count
}
NAMESPACE = "namespace"
_BY_ALIAS = {alias: name for name, quantity in QUANTITIES.items() for alias in quantity.aliases.split()}


class ColumnSettings(Settings):
    """How one quantity is to be read."""

    column: str = ""
    constant: float | None = Field(default=None, description="instead of a column: one value for all times")
    unit: str | None = Field(default=None, description="unit of the column, if its header does not say")
    sign: float = Field(default=1.0, description="-1 turns the column's positive direction round")
    offset: float = Field(default=0.0, description="added after that, in the column's unit: 90 for a heading from east")
    time: str | None = Field(default=None, description="its own column of time stamps")
    sd: float | None = Field(default=None, gt=0, description="standard deviation of a sample, in the column's unit")

    @model_validator(mode="after")
    def _has_a_source(self) -> "ColumnSettings":
        if bool(self.column) == (self.constant is not None):
            raise ValueError("give either a column or a constant")
        return self


@dataclass(frozen=True, kw_only=True, slots=True)
class Meaning:
    """A column understood."""

    quantity: str
    column: str
    factor: float  # from its values to SI
    offset: float = 0.0  # added after that [SI]
    declared: bool = True  # whether the file or a map gives its unit
    time: str | None = None  # its own column of time stamps
    deviation: float | None = None  # of a sample [SI]
    assumed: str | None = None  # the unit that was taken because none was given


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit of `heading [deg]`, `heading (deg)` or `heading_deg`; None without a unit."""
    header = header.strip()
    bracketed = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]", header)
    if bracketed:
        return bracketed[1], bracketed[2].strip()
    parts = header.split("_")
    for count in (2, 1):  # `u_m_s` before `u_s`
        unit = "_".join(parts[-count:])
        if len(parts) > count and _spelled(unit) is not None and len(unit) > 1:
            return "_".join(parts[:-count]), unit
    return header, None


def quantity_of(name: str) -> str | None:
    """The quantity that goes by a name, None if there is none."""
    return _BY_ALIAS.get(plain(name))


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is understood."""
    return bool(text) and _spelled(text) is not None


def _spelled(unit: str) -> str | None:
    """The spelling of UNITS for a unit, None if it is not known."""
    plain = _SPELLINGS.get(unit.lower(), unit.lower())
    return plain if any(plain in units for units in UNITS.values()) else None


def plain(name: str) -> str:
    """A name as aliases are written."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def factor(unit: str, quantity: str, where: str) -> float:
    """What a value in a unit is to be multiplied by to be in SI.

    Raises:
        InputError: The unit is none of the quantity's.
    """
    known = UNITS[QUANTITIES[quantity].kind]
    spelled = _spelled(unit)
    if spelled not in known:
        raise InputError(f"{where}: '{unit}' is no unit of {quantity}; there are {', '.join(known)}")
    return known[spelled]


def read_map(path: Path) -> dict[str, ColumnSettings]:
    """Reads a mapping file: for each quantity a column's header, or a mapping of ColumnSettings.

    Raises:
        InputError: With the file and the quantity at fault.
    """
    document = yaml_text.load(path)
    if not isinstance(document.value, Mapping):
        raise InputError(f"{path}: a column map is a mapping such as `rudder: {{column: delta, unit: deg, sign: -1}}`")
    found = {}
    for name, value in document.value.items():
        where = document.places.get(str(name), str(path))
        if name not in QUANTITIES:
            raise InputError(f"{where}: {unknown_name('quantity', str(name), list(QUANTITIES))}")
        try:
            given = {"column": value} if isinstance(value, str) else value
            found[name] = TypeAdapter(ColumnSettings).validate_python(given)
        except ValidationError as error:
            report = error.errors(include_url=False)[0]
            key = ".".join(map(str, (name, *report["loc"])))
            keys = ", ".join(ColumnSettings.model_fields)
            raise InputError(f"{where}: {key}: {report['msg'].lower()}; a column has {keys}") from None
    return found


def understand(
    headers: Mapping[str, str | None], mapping: Mapping[str, ColumnSettings], where: str
) -> tuple[list[Meaning], list[str]]:
    """What the columns of a file mean, and those that mean nothing.

    Args:
        headers: Names of columns with the unit a file gives apart from the name, None where it gives none.
        mapping: What a mapping file says; goes before names.
        where: The file, for errors.

    Raises:
        InputError: A mapped column is not there, a unit does not fit, or two columns are the same quantity.
    """
    meanings = [_mapped(name, settings, headers, where) for name, settings in mapping.items() if settings.column]
    stamps = {own for header in headers if (own := _time_of(header)) is not None}
    taken = {meaning.column for meaning in meanings} | {m.time for m in meanings}
    unknown = []
    for header, unit in headers.items():
        name, own = split_header(header)
        quantity = quantity_of(name) or quantity_of(header)
        if header in taken or _time_of(header) is not None:
            continue
        if quantity is None or quantity in mapping:
            unknown.append(header)
            continue
        if any(meaning.quantity == quantity for meaning in meanings):
            other = next(meaning.column for meaning in meanings if meaning.quantity == quantity)
            raise InputError(f"{where}: columns '{other}' and '{header}' are both {quantity}; choose with --columns")
        meanings.append(_meaning(quantity, header, unit or own, where))
    return [_with_stamps(meaning, headers, stamps) for meaning in meanings], unknown


def _mapped(name: str, settings: ColumnSettings, headers: Mapping[str, str | None], where: str) -> Meaning:
    column = settings.column
    if column not in headers:
        same = [header for header in headers if split_header(header)[0] == column]
        column = same[0] if len(same) == 1 else column
    for wanted in (column, settings.time):
        if wanted is not None and wanted not in headers:
            raise InputError(f"{where}: {name}: {unknown_name('column', wanted, list(headers))}")
    unit = settings.unit or headers[column] or split_header(column)[1]
    meaning = _meaning(name, column, unit, where)
    return replace(
        meaning,
        factor=settings.sign * meaning.factor,
        offset=settings.offset * meaning.factor,
        time=settings.time,
        deviation=None if settings.sd is None else settings.sd * meaning.factor,
    )


def _meaning(quantity: str, column: str, unit: str | None, where: str) -> Meaning:
    if plain(column) == "rpm":
        unit = unit or "rpm"
    units = UNITS[QUANTITIES[quantity].kind]
    if unit is None or quantity == "manoeuvre":
        assumed = None if quantity in ("manoeuvre", "time") else next(iter(units))
        return Meaning(quantity=quantity, column=column, factor=1.0, assumed=assumed, declared=unit is not None)
    if quantity == "time" and " since " in unit:  # as NetCDF's conventions give it
        unit = unit.split(" since ")[0]
    return Meaning(quantity=quantity, column=column, factor=factor(unit, quantity, f"{where}: column '{column}'"))


def _time_of(header: str) -> str | None:
    """What a column such as `time_dvl`, `t_heading` or `dvl_time` stamps."""
    found = re.fullmatch(r"(?:time|t|stamp)_(.+)|(.+)_(?:time|stamp)", plain(split_header(header)[0]))
    if found is None or plain(header) in _BY_ALIAS:
        return None
    return found[1] or found[2]


def _with_stamps(meaning: Meaning, headers: Mapping[str, str | None], stamps: set[str]) -> Meaning:
    """The same with its own time column, if there is one of its name or its sensor's."""
    if meaning.time is not None or not stamps:
        return meaning
    names = [meaning.quantity, plain(split_header(meaning.column)[0]), *QUANTITIES[meaning.quantity].sensor.split()]
    own = next((name for name in names if name in stamps), None)
    column = next((header for header in headers if own is not None and _time_of(header) == own), None)
    return replace(meaning, time=column)
