"""Tests draw as the command does: without a display, where OpenGL is there."""

from auvsim.cli.renderer import choose_renderer

choose_renderer()  # before any test imports MuJoCo
