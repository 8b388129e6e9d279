"""A vehicle and a dock without the symmetries of the shipped ones, for terms that vanish there."""

from pathlib import Path

from auvsim.vehicles import model_files

MASS = 30.87  # of the hull [kg]
X_G, Y_G = 0.11, -0.03  # centre of gravity of the hull, ahead and to starboard of the origin [m]
Y_RD = -6.0  # of the hull; positive definite together with Y_vd = -29.44 and N_rd = -3.426 [kg m]
TRANSPONDER = (0.45, -0.3, -0.1)  # in the vehicle's body frame [m]
DOCK_HEADING = 0.6  # [rad]


def vehicle(folder: Path, *, x_g: float = X_G, y_g: float = 0.0) -> str:
    """Writes the MJCF of a REMUS-100 with its weight and its added mass off-centre; returns its path.

    Args:
        folder: Where to write it.
        x_g: Centre of gravity of the hull ahead of the origin [m].
        y_g: The same to starboard [m]; the planar model has no such term.
    """
    text = (model_files.models_folder() / "remus100" / "remus100.xml").read_text(encoding="utf-8")
    for old, new in (
        ('<inertial pos="0.004048 0 -0.020104"', f'<inertial pos="{x_g} {-y_g} -0.020104"'),  # MuJoCo's y is to port
        ("0.839 0 0 0 0 0  0 29.44 0 0 0 0 ", f"0.839 0 0 0 0 0  0 29.44 0 0 0 {-Y_RD} "),
        ("0 0 0 0 0 3.426", f"0 {-Y_RD} 0 0 0 3.426"),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "lopsided.xml"
    path.write_text(text, encoding="utf-8")
    return str(path)
