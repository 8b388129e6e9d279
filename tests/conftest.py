"""Tests draw as the command does: `auvsim` chooses the renderer before any of them imports MuJoCo."""

import auvsim  # noqa: F401
