"""Offsets of the fields of MuJoCo's C structs, from MuJoCo's own introspection, verified before use."""

import ctypes
from functools import cache
from typing import Any

import mujoco
from mujoco.introspect import structs

from auvsim.base.errors import AuvsimError

_SIZES = {"int": 4, "float": 4, "double": 8, "char": 1, "mjtByte": 1, "mjtBool": 1, "mjtNum": 8, "mjtSize": 8}
_SIZES |= {"size_t": 8, "uint64_t": 8, "uintptr_t": 8}


def _extent(kind: Any) -> tuple[int, int]:
    """Size and alignment [bytes] of an introspected type, by the rules of the C ABI of 64-bit platforms."""
    name = type(kind).__name__
    if name == "PointerType":
        return 8, 8
    if name == "ArrayType":
        size, align = _extent(kind.inner_type)
        count = 1
        for n in kind.extents:
            count *= n
        return size * count, align
    if name == "ValueType":
        if kind.name in _SIZES:
            return _SIZES[kind.name], _SIZES[kind.name]
        if kind.name in structs.STRUCTS:
            return _walk(structs.STRUCTS[kind.name].fields)[1:]
        return 4, 4  # enumerations
    return _walk(kind.fields)[1:]  # anonymous struct


def _walk(fields: Any) -> tuple[dict[str, int], int, int]:
    """Offsets by name, size and alignment of a struct."""
    offsets, at, widest = {}, 0, 1
    for field in fields:
        size, align = _extent(field.type)
        at = -(-at // align) * align
        offsets[field.name] = at
        at += size
        widest = max(widest, align)
    return offsets, -(-at // widest) * widest, widest


@cache
def offsets(struct: str) -> dict[str, int]:
    """Offset [bytes] of every field of `mjModel`, `mjData` or `mjOption`."""
    return _walk(structs.STRUCTS[struct].fields)[0]


def verify() -> None:
    """Compares the computed offsets with the addresses that MuJoCo's own arrays have.

    Raises:
        AuvsimError: MuJoCo's structs are laid out otherwise than its introspection says.
    """
    body = "<worldbody><body><freejoint/><geom size='1'/><site name='s'/></body></worldbody>"
    body += "<actuator><general site='s' dyntype='filter'/></actuator>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco><size nuser_body='2' nuserdata='3'/>{body}</mujoco>")
    data = mujoco.MjData(model)
    for struct, owner, names in (
        ("mjModel", model, ("body_user", "body_weldid", "body_dofadr", "dof_parentid", "M_rowadr", "body_rootid")),
        (
            "mjData",
            data,
            ("M", "qfrc_passive", "userdata", "cvel", "cdof", "xpos", "xmat", "subtree_com", "qvel", "act", "ctrl"),
        ),
    ):
        for name in names:
            found = ctypes.c_void_p.from_address(owner._address + offsets(struct)[name]).value
            if found != getattr(owner, name).ctypes.data:
                raise AuvsimError(f"MuJoCo {mujoco.__version__}: {struct}.{name} is not where its introspection says")
    gravity = (ctypes.c_double * 3).from_address(
        model._address + offsets("mjModel")["opt"] + offsets("mjOption")["gravity"]
    )
    if list(gravity) != list(model.opt.gravity):
        raise AuvsimError(f"MuJoCo {mujoco.__version__}: mjOption.gravity is not where its introspection says")
