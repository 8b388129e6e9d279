"""Struct offsets: right on this MuJoCo, and a wrong one is an error before anything is read through it."""

import ctypes

import mujoco
import pytest

from auvsim.base.errors import AuvsimError
from auvsim.physics import mujoco_structs


def test_the_offsets_verify():
    mujoco_structs.verify()


def test_scalars_are_where_they_should_be():
    """Beyond the arrays that verify() looks at: sizes in the model and the time in the data."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><size nuser_body='5'/><worldbody><body/><body/></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.time = 1.25
    assert ctypes.c_int64.from_address(model._address + mujoco_structs.offsets("mjModel")["nbody"]).value == 3
    assert ctypes.c_int64.from_address(model._address + mujoco_structs.offsets("mjModel")["nuser_body"]).value == 5
    assert ctypes.c_double.from_address(data._address + mujoco_structs.offsets("mjData")["time"]).value == 1.25


@pytest.mark.parametrize(
    ("struct", "field"), [("mjModel", "body_user"), ("mjData", "cvel"), ("mjData", "userdata"), ("mjOption", "gravity")]
)
def test_a_wrong_offset_is_an_error_that_names_it(monkeypatch, struct, field):
    right = mujoco_structs.offsets

    def wrong(name):
        table = dict(right(name))
        if name == struct:
            table[field] += 8
        return table

    monkeypatch.setattr(mujoco_structs, "offsets", wrong)
    with pytest.raises(AuvsimError, match=rf"MuJoCo {mujoco.__version__}: {struct}\.{field} is not where"):
        mujoco_structs.verify()


def test_an_unknown_struct_is_not_guessed():
    with pytest.raises(KeyError):
        mujoco_structs.offsets("mjNothing")
