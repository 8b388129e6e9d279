"""What a log of today holds that one of an earlier format does not, or holds otherwise.

Logs of every format are compared as `auvsim.data.log.read` gives them: what only has another name or place is equal.
A path is `group/variable`; an attribute of a group is `group@attribute`, one of the file `@attribute`.
"""

# Groups with all below them, variables and attributes that no log of formats 1 and 2 has.
NEW: tuple[str, ...] = (
    "vehicles/remus100/measurements",
    "vehicles/remus100@length",
    "vehicles/remus100@estimator",
    "vehicles/remus100@controller",
    "vehicles/remus100@mission_settings",
    "vehicles/remus100@usbl_structure",
    "structures/dock@latched",
    "network/messages",
)

# Paths whose values differ, each with the reason.
CHANGED: dict[str, str] = {
    "@scenario": "the full form; the text of the old one is kept in converted logs",
    "vehicles/remus100@model": "converted logs know it by its file's stem",
    "structures/dock@throat_length": "earlier logs did not have it; drawings took 0.6 m",
    "vehicles/remus100/contact/other": "earlier logs did not say what was touched",
    "vehicles/remus100/estimate/position": "its depth: one alpha-beta filter smooths it now; 2e-14 m at most",
    "vehicles/remus100@dock": "a manoeuvre has no dock of its own; converted logs name the one that was there",
    "event/vehicle": "earlier logs had one vehicle, and did not say which events are of the run",
}

# What may differ between two runs of the same scenario: wall-clock time and versions, and words in a model's file.
FREE = (
    "models",
    "@wall_time",
    "@format_version",
    "@auvsim_version",
    "@mujoco_version",
    "@numpy_version",
    "@numba_version",
)


def below(path: str, group: str) -> bool:
    """Whether a path is that of a group or variable, or stands below it."""
    return path == group or path.startswith((f"{group}/", f"{group}@"))
