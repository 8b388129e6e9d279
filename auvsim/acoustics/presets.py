"""What an acoustic modem can do, and presets of real ones.

Each number of a preset has its source beside it. "Assumed" marks those that no public text which could be read states,
those cited after a text that could not be read again among them.
"""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Modem:
    """What a modem can do; units as in `ModemSettings`."""

    bit_rate: float
    preamble: float
    frequency: float
    bandwidth: float
    source_level: float
    coding_gain: float
    processing: float
    processing_jitter: float
    timing_noise: float
    bearing_noise_deg: float | None = None  # None: it measures none

    def duration(self, bits: float) -> float:
        """Duration of a packet [s]."""
        return self.preamble + bits / self.bit_rate

    def hears(self, other: "Modem") -> bool:
        """Whether the bands of two modems overlap; else they neither hear nor disturb each other."""
        return abs(self.frequency - other.frequency) < 0.5 * (self.bandwidth + other.bandwidth)


PRESETS = {
    # WHOI Micro-Modem, frequency-hopping FSK, packet type 0: Freitag et al., OCEANS 2005; its page on packet rates,
    # acomms.whoi.edu/micro-modem.
    "micromodem_fsk": Modem(
        bit_rate=80.0,  # the paper and the page
        preamble=0.3,  # the page: a signal lasts 0.30 s longer than its packet; for type 6 in PSK, here assumed
        frequency=25_000.0,  # assumed: one of its four bands between 3 and 30 kHz, the paper
        bandwidth=4_000.0,  # the page
        source_level=185.0,  # assumed
        coding_gain=4.0,  # assumed: of a convolutional code of rate 1/2, which ns-3's model of it has
        processing=0.5,  # assumed
        processing_jitter=0.1,  # assumed
        timing_noise=125e-6,  # assumed, as cited: Eustice et al., J. Field Robotics 28(1), 2011
    ),
    # The same in phase-coherent keying, at the bit rate of its packet type 6.
    "micromodem_psk": Modem(
        bit_rate=490.0,  # the page
        preamble=0.3,  # the page: 3.25 s of signal, 2.95 s of packet
        frequency=25_000.0,  # assumed, as above
        bandwidth=5_000.0,  # the page
        source_level=185.0,  # assumed
        coding_gain=6.0,  # assumed
        processing=0.5,  # assumed
        processing_jitter=0.1,  # assumed
        timing_noise=125e-6,  # assumed, as above
    ),
    # EvoLogics S2C R 18/34 with USBL: the maker's product information.
    "s2c_r_18_34": Modem(
        bit_rate=13_900.0,  # up to
        preamble=0.1,  # assumed
        frequency=26_000.0,  # band of 18 to 34 kHz
        bandwidth=16_000.0,  # the same
        source_level=184.0,  # assumed
        coding_gain=6.0,  # assumed
        processing=0.2,  # assumed
        processing_jitter=0.05,  # assumed
        timing_noise=6.7e-6,  # assumed: slant range to 0.01 m at 1500 m/s
        bearing_noise_deg=0.1,  # assumed
    ),
    # Blueprint Subsea SeaTrac X150 USBL beacon: the maker's data sheet.
    "seatrac_x150": Modem(
        bit_rate=100.0,
        preamble=0.1,  # assumed
        frequency=28_000.0,  # band of 24 to 32 kHz
        bandwidth=8_000.0,  # the same
        source_level=176.0,  # assumed, as cited after the data sheet
        coding_gain=6.0,  # assumed: spread spectrum
        processing=0.2,  # assumed
        processing_jitter=0.05,  # assumed
        timing_noise=33e-6,  # assumed: range to 0.05 m at 1500 m/s; its protocol gives ranges in steps of 0.1 m
        bearing_noise_deg=1.0,  # accuracy of bearings
    ),
    # Teledyne Benthos ATM-900 series, low band: the maker's manual M-270-26.
    "atm_900": Modem(
        bit_rate=140.0,  # assumed, as cited: the slowest of 140 to 15 360 bit/s
        preamble=0.5,  # assumed
        frequency=11_500.0,  # band of 9 to 14 kHz
        bandwidth=5_000.0,  # the same
        source_level=183.0,  # assumed
        coding_gain=4.0,  # assumed: of a convolutional code, which the manual has
        processing=0.5,  # assumed
        processing_jitter=0.1,  # assumed
        timing_noise=0.3e-3,  # assumed
    ),
}
