"""Where what a log of format 2 holds is found in a log of today's format.

A path is `group/variable`; an attribute of a group is `group@attribute`, one of the file `@attribute`.
"""

# Old path to new; an entry also moves all that stands below its path, and the first entry that fits a new path counts.
# Several new paths are the columns of the old variable in turn. What no entry names has kept its path.
RENAMED: dict[str, str | tuple[str, ...]] = {}

# New paths, groups with all below them, that no log of format 2 has.
NEW: tuple[str, ...] = ()

# Old paths whose value has another form now, each with the reason.
CHANGED: dict[str, str] = {}

# What may differ between two runs of the same trial: wall-clock time and versions.
FREE = ("@wall_time", "@format_version", "@auvsim_version", "@mujoco_version", "@numpy_version", "@numba_version")


def below(path: str, group: str) -> bool:
    """Whether a path is that of a group or variable, or stands below it."""
    return path == group or path.startswith((f"{group}/", f"{group}@"))
