"""The parameter set that an identification leaves."""

import math

import auvsim
from auvsim.identification.pipeline import Identification
from auvsim.physics.planar_sets import HoldOut, Noise, PlanarSet, coefficients


def planar_set(found: Identification) -> PlanarSet:
    """All parameters with their intervals, provenance and verdict; the same for the same data, wherever it is made."""
    intervals = {
        name: tuple(end if math.isfinite(end) else None for end in ends) for name, ends in found.intervals.items()
    }
    worst = max(found.judged, key=lambda judged: judged.share)
    noise = (
        None
        if found.fit.noise is None
        else Noise(**dict(zip(Noise.model_fields, found.fit.noise.tolist(), strict=True)))
    )
    return PlanarSet(
        vehicle=found.vehicle,
        speed=found.speed,
        method=", ".join(fit.method for fit in found.fits),
        start=found.start_text,
        version=auvsim.__version__,
        sources=found.readings.sources,
        hold_out=HoldOut(
            record=worst.record.name, seconds=worst.seconds, share=worst.share, start_share=worst.start_share
        ),
        verdict=tuple(verdict.text for verdict in found.verdicts),
        parameters=coefficients(found.fit.parameters, intervals),  # pyright: ignore[reportArgumentType]
        noise=noise,
    )
