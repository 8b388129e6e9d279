"""Beams of an imaging sonar's line array: echoes from all directions, heard together and steered to each beam.

The sector is lit as a whole and heard by a line of elements half a wavelength apart, with a Hann shading. A beam is
then as wide as the array makes it, wider off its axis, has side lobes, and shares speckle with its neighbours.
"""

import numpy as np
from numpy.random import Generator

from auvsim.base.frames import Array

HANN_WIDTH = 1.44  # of the main lobe at half power, by the inverse of the array's length (Harris 1978, table 1)


def beam_width(elements: int) -> float:
    """Width [rad] at half power of a beam square to the array."""
    return 2.0 * HANN_WIDTH / elements


def response(bearings: Array, elements: int) -> Array:
    """Amplitudes (beams, directions) of beams steered to bearings (n,) [rad] for echoes from the same bearings.

    The squares of each row sum to 1, as the share of each direction in what a beam hears.
    """
    sines = np.sin(bearings)
    place = np.arange(elements) - 0.5 * (elements - 1)  # half wavelengths
    shading = 0.5 + 0.5 * np.cos(2.0 * np.pi * place / elements)
    phases = np.exp(1j * np.pi * np.outer(sines, place))
    amplitudes = np.real((shading * phases) @ phases.conj().T)  # of a symmetric array they are real
    return np.asarray(amplitudes / np.linalg.norm(amplitudes, axis=1, keepdims=True), dtype=float)


def steered(amplitudes: Array, power: Array, generator: Generator) -> np.ndarray:
    """Intensities (beams, bins) of one ping, of scatterers with random phases.

    Args:
        amplitudes: (beams, directions), see `response`.
        power: (directions, bins) mean intensity from each direction, with the noise that comes from there.
        generator: of the phases and amplitudes, two normals for each direction and bin.
    """
    deviations = np.sqrt(0.5 * power).astype(np.float32)
    turned = amplitudes.astype(np.float32)
    parts = (turned @ (deviations * generator.standard_normal(power.shape, dtype=np.float32)) for _ in range(2))
    return np.asarray(sum(part * part for part in parts))
