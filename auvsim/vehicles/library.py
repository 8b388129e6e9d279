"""Finds models/ (in a checkout or in the installed package) and loads vehicles and docks as PyMJCF elements."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from dm_control import mjcf

import auvsim
from auvsim.base.errors import InputError, unknown_name
from auvsim.vehicles.allocation import Allocation


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A vehicle's MJCF and what the rest of the system needs to know of it."""

    name: str
    root: Any  # PyMJCF RootElement, a fresh one each load
    allocation: Allocation
    shaft_limit: float  # largest shaft speed [rad/s]
    nose: float  # the nose's distance ahead of the body origin [m]


@dataclass(frozen=True, kw_only=True)
class Dock:
    """A funnel dock's MJCF and its dimensions."""

    name: str
    root: Any  # PyMJCF RootElement, a fresh one each load
    mouth_radius: float  # [m]
    throat_radius: float  # [m]
    cone_length: float  # mouth to throat along the axis [m]
    latched: float  # where the latch holds the nose, along the axis from the mouth [m]


PACKAGE = Path(auvsim.__file__).parent
_MARKS = {"vehicle": '<body name="hull"', "dock": '<site name="capture"'}  # what every MJCF of a kind has


def models_folder() -> Path:
    """The folder of the models: inside the installed package, else beside it in a checkout."""
    for folder in (PACKAGE / "models", PACKAGE.parent / "models"):
        if folder.is_dir():
            return folder
    raise InputError(f"no models folder inside or beside {PACKAGE}; reinstall auvsim")


@cache
def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"model {path}: {error}") from None


def _load(kind: str, name: str) -> Any:
    """The MJCF of a shipped model by name, or of the user's own by the path of its `.xml`."""
    if name.endswith(".xml"):
        path = Path(name).expanduser()
    else:
        folder = models_folder()
        path = folder / name / f"{name}.xml"
        if not path.is_file():
            known = [p.stem for p in folder.glob("*/*.xml") if p.stem == p.parent.name and _MARKS[kind] in _read(p)]
            raise unknown_name(kind, name, known)
    try:
        return mjcf.from_xml_string(_read(path), model_dir=str(path.parent))
    except InputError:
        raise
    except Exception as error:  # PyMJCF raises whatever its parsers do
        raise InputError(f"model {path}: {' '.join(str(error).split())[:200]}") from None


def _numeric(root: Any, where: str, name: str) -> Any:
    element = root.find("numeric", name)
    if element is None:
        raise InputError(f"model {where} lacks the numeric '{name}'")
    return np.atleast_1d(np.array(element.data, dtype=float))


def _site_x(root: Any, where: str, name: str) -> float:
    site = root.find("site", name)
    if site is None:
        raise InputError(f"model {where} lacks the site '{name}'")
    return float(site.pos[0])


def _limit(root: Any, where: str, name: str) -> float:
    actuator = root.find("actuator", name)
    if actuator is None:
        raise InputError(f"model {where} lacks the actuator '{name}'")
    limits = actuator.ctrlrange
    if limits is None and actuator.dclass is not None:
        limits = getattr(actuator.dclass, actuator.tag).ctrlrange
    if limits is None:
        raise InputError(f"model {where}: actuator '{name}' needs a ctrlrange")
    return float(np.min(np.abs(limits)))


def vehicle(name: str) -> Vehicle:
    """Loads a vehicle: `remus100`, or the path of an MJCF file that keeps the contract of models/README.md.

    Raises:
        InputError: there is no such model, or it breaks the contract; the text says where.
    """
    root = _load("vehicle", name)
    if root.find("body", "hull") is None:
        raise InputError(f"model {name} lacks the body 'hull'")
    fins = tuple(a.name for a in root.find_all("actuator") if a.name != "shaft")
    matrix = np.stack([_numeric(root, name, f"allocation_{axis}") for axis in ("rudder", "elevator")], axis=-1)
    limit = min((_limit(root, name, fin) for fin in fins), default=0.0)
    return Vehicle(
        name=root.model,
        root=root,
        allocation=Allocation(names=fins, matrix=matrix, limit=limit),
        shaft_limit=_limit(root, name, "shaft"),
        nose=_site_x(root, name, "nose"),
    )


def dock(name: str) -> Dock:
    """Loads a dock: `dock`, or the path of an MJCF file that keeps the contract of models/README.md.

    Raises:
        InputError: there is no such model, or it breaks the contract; the text says where.
    """
    root = _load("dock", name)
    _site_x(root, name, "capture")
    return Dock(
        name=root.model,
        root=root,
        mouth_radius=float(_numeric(root, name, "mouth_radius")[0]),
        throat_radius=float(_numeric(root, name, "throat_radius")[0]),
        cone_length=float(_numeric(root, name, "cone_length")[0]),
        latched=_site_x(root, name, "latched"),
    )
