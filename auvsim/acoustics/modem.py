"""Settings of acoustic modems: what they can do, by presets of real ones, and what they send by themselves."""

from dataclasses import fields, replace
from typing import Annotated, Literal

from pydantic import Field, model_validator

from auvsim.acoustics.presets import PRESETS, Modem
from auvsim.base.settings import Settings

Offset = Annotated[float, Field(ge=-20.0, le=20.0)]  # from the body's origin [m]


class TellSettings(Settings):
    """What a modem tells all others of its vehicle's own estimate, and when."""

    period: float | None = Field(default=None, ge=0.1, description="time between two; none: only when asked [s]")
    phase: float = Field(default=0.0, ge=0.0, description="time of the first, by the modem's clock [s]")
    jitter: float = Field(default=0.0, ge=0.0, description="half width of their uniform spread about their times [s]")
    random: bool = Field(default=False, description="whether times between two are exponential, with mean period")
    delay: float = Field(
        default=0.0, ge=0.0, description="time from a pulse for ranging to its packet; 0: the packet is the pulse [s]"
    )


class AskSettings(Settings):
    """A request for another's state, whose reply gives the range by two-way travel time."""

    whom: str | None = Field(default=None, description="vehicle that is asked; none: nobody is")
    period: float = Field(default=10.0, ge=0.1, description="time between two requests [s]")
    phase: float = Field(default=0.0, ge=0.0, description="time of the first, by the modem's clock [s]")
    jitter: float = Field(default=0.0, ge=0.0, description="half width of their uniform spread about their times [s]")


class ModemSettings(Settings):
    """An acoustic modem. Whatever is none is the preset's (see the page on acoustics for sources)."""

    preset: Literal["micromodem_fsk", "micromodem_psk", "s2c_r_18_34", "seatrac_x150", "atm_900"] = Field(
        default="micromodem_psk", description=", ".join(PRESETS)
    )
    bit_rate: float | None = Field(default=None, ge=1.0, description="bit rate [bit/s]")
    preamble: float | None = Field(default=None, ge=0.0, description="duration before the first bit [s]")
    frequency: float | None = Field(default=None, ge=400.0, le=1e5, description="centre of the band [Hz]")
    bandwidth: float | None = Field(default=None, gt=0.0, description="width of the band [Hz]")
    source_level: float | None = Field(default=None, gt=0.0, description="source level [dB re 1 uPa at 1 m]")
    coding_gain: float | None = Field(default=None, ge=0.0, description="gain of the code [dB]")
    processing: float | None = Field(default=None, ge=0.0, description="time to decode a packet that is in [s]")
    processing_jitter: float | None = Field(default=None, ge=0.0, description="half width of its uniform spread [s]")
    timing_noise: float | None = Field(default=None, ge=0.0, description="white noise of arrival times, sd [s]")
    bearing_noise_deg: float | None = Field(
        default=None,
        ge=0.0,
        description="white noise of bearings, sd; none: the preset's, which may measure none [deg]",
    )
    bearing_bias_deg: float = Field(default=0.0, description="constant error of bearings (mounting) [deg]")
    one_way: bool = Field(default=True, description="whether it takes ranges by one-way travel time")
    sound_speed: float = Field(
        default=1500.0, ge=1000.0, le=2000.0, description="sound speed that it assumes [m/s of sound]"
    )
    turn_around: float = Field(
        default=2.0, gt=0.0, description="known time from the first wave front of a request to that of the reply [s]"
    )
    transducer: tuple[Offset, Offset, Offset] = Field(
        default=(0.0, 0.0, 0.0), description="place in the vehicle's body frame [m]"
    )
    tell: TellSettings = TellSettings()
    ask: AskSettings = AskSettings()

    @property
    def modem(self) -> Modem:
        """The preset's numbers, with those given in their place."""
        own = {field.name: getattr(self, field.name) for field in fields(Modem)}
        return replace(PRESETS[self.preset], **{name: value for name, value in own.items() if value is not None})

    @model_validator(mode="after")
    def _decodes(self) -> "ModemSettings":
        if (jitter := self.modem.processing_jitter) > (processing := self.modem.processing):
            raise ValueError(f"processing_jitter is {jitter} s, it must not exceed processing, {processing} s")
        return self
