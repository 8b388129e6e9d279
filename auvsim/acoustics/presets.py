"""Presets of modems. Each number has its source beside it; what no public source gives is marked as assumed."""

from typing import NamedTuple


class Preset(NamedTuple):
    """Numbers of a modem; units as in `ModemSettings`."""

    bit_rate: float
    preamble: float
    frequency: float
    bandwidth: float
    source_level: float
    coding_gain: float
    processing: float
    processing_jitter: float
    timing_noise: float
    bearing_noise_deg: float | None = None


PRESETS = {
    # WHOI Micro-Modem, frequency-hopping FSK: Freitag et al., OCEANS 2005, and acomms.whoi.edu/micro-modem.
    "micromodem_fsk": Preset(
        bit_rate=80.0,  # the same
        preamble=0.3,  # probe and null before a packet, the same page (difference of signal and packet length)
        frequency=25_000.0,  # one of four bands between 3 and 30 kHz
        bandwidth=4_000.0,  # the same page
        source_level=185.0,  # assumed
        coding_gain=4.0,  # assumed: rate 1/2 convolutional
        processing=0.5,  # assumed
        processing_jitter=0.1,  # assumed
        timing_noise=125e-6,  # resolution of arrival times; Eustice et al., J. Field Robotics 28(1), 2011
    ),
    # The same in phase-shift keying, rate 6.
    "micromodem_psk": Preset(
        bit_rate=490.0,  # burst rate of 6 frames of 32 bytes, acomms.whoi.edu/micro-modem
        preamble=0.3,  # the same table: signal of 3.25 s, packet of 2.95 s
        frequency=25_000.0,  # as above
        bandwidth=5_000.0,  # the same page
        source_level=185.0,  # assumed
        coding_gain=6.0,  # assumed
        processing=0.5,  # assumed
        processing_jitter=0.1,  # assumed
        timing_noise=125e-6,  # as above
    ),
    # EvoLogics S2C R 18/34 with USBL: the maker's product information.
    "s2c_r_18_34": Preset(
        bit_rate=13_900.0,  # up to
        preamble=0.1,  # assumed
        frequency=26_000.0,  # band of 18 to 34 kHz
        bandwidth=16_000.0,  # the same
        source_level=184.0,  # assumed
        coding_gain=6.0,  # assumed
        processing=0.2,  # assumed
        processing_jitter=0.05,  # assumed
        timing_noise=6.7e-6,  # slant range to 0.01 m at 1500 m/s
        bearing_noise_deg=0.1,  # bearing resolution
    ),
    # Blueprint Subsea SeaTrac X150 USBL beacon: the maker's data sheet.
    "seatrac_x150": Preset(
        bit_rate=100.0,
        preamble=0.1,  # assumed
        frequency=28_000.0,  # band of 24 to 32 kHz
        bandwidth=8_000.0,  # the same
        source_level=176.0,
        coding_gain=6.0,  # assumed: spread spectrum
        processing=0.2,  # assumed
        processing_jitter=0.05,  # assumed
        timing_noise=33e-6,  # range resolution of 0.05 m at 1500 m/s
        bearing_noise_deg=1.0,  # angular resolution
    ),
    # Teledyne Benthos ATM-900 series, low band: the maker's data sheet and manual M-270-26.
    "atm_900": Preset(
        bit_rate=140.0,  # slowest of 140 to 15 360 bit/s
        preamble=0.5,  # assumed
        frequency=11_500.0,  # band of 9 to 14 kHz
        bandwidth=5_000.0,  # the same
        source_level=183.0,  # assumed
        coding_gain=4.0,  # assumed: rate 1/2 convolutional, as the manual says
        processing=0.5,  # assumed
        processing_jitter=0.1,  # assumed
        timing_noise=0.3e-3,  # assumed
    ),
}
