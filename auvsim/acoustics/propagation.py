"""Levels of sound, and how many packets noise destroys.

Spreading and Thorp's absorption, and the noise of turbulence, shipping, wind and heat, are those of Stojanovic, "On the
relationship between capacity and distance in an underwater acoustic communication channel" (2007), after Brekhovskikh
and Lysanov (2003) and Coates (1989). Frequencies are in Hz, levels in dB re 1 uPa at 1 m.
"""

import math


def absorption(frequency: float) -> float:
    """Thorp's absorption [dB/km], for frequencies of some 0.4 to 50 kHz."""
    f2 = (frequency / 1e3) ** 2
    return 0.11 * f2 / (1.0 + f2) + 44.0 * f2 / (4100.0 + f2) + 2.75e-4 * f2 + 0.003


def transmission_loss(distance: float, frequency: float, spreading: float = 1.5) -> float:
    """Loss of level [dB] over a distance [m]: spreading * 10 log10(r), and absorption.

    `spreading` is 2 for spheres, 1 for cylinders. Nearer than 1 m nothing is lost.
    """
    r = max(distance, 1.0)
    return 10.0 * spreading * math.log10(r) + absorption(frequency) * r / 1e3


def noise_density(frequency: float, wind: float = 5.0, shipping: float = 0.5) -> float:
    """Density of the ambient noise [dB re 1 uPa^2/Hz].

    Args:
        frequency: of interest [Hz].
        wind: speed over the surface [m/s].
        shipping: activity, from 0 to 1.
    """
    f = frequency / 1e3
    log = math.log10(f)
    parts = (
        17.0 - 30.0 * log,
        40.0 + 20.0 * (shipping - 0.5) + 26.0 * log - 60.0 * math.log10(f + 0.03),
        50.0 + 7.5 * math.sqrt(wind) + 20.0 * log - 40.0 * math.log10(f + 0.4),
        -15.0 + 20.0 * log,
    )
    return to_decibel(sum(from_decibel(part) for part in parts))


def packet_success(snr: float, bits: float, bandwidth: float, bit_rate: float, coding_gain: float = 0.0) -> float:
    """Probability that no bit of a packet is wrong: (1 - exp(-Eb/N0 / 2) / 2)^bits.

    The bit error rate is that of binary frequency shift keying, detected without phase (Proakis 2001, eq. 5.2-69);
    Eb/N0 is the signal-to-noise ratio times bandwidth over bit rate, and a gain for the code.

    Args:
        snr: signal-to-noise ratio in the bandwidth [dB].
        bits: in the packet.
        bandwidth: of the modem [Hz].
        bit_rate: [bit/s].
        coding_gain: of the code [dB].
    """
    per_bit = from_decibel(snr + coding_gain) * bandwidth / bit_rate
    return math.exp(bits * math.log1p(-0.5 * math.exp(-0.5 * per_bit)))


def from_decibel(level: float) -> float:
    """Intensity of a level [dB]."""
    return 10.0 ** (level / 10.0)


def to_decibel(intensity: float) -> float:
    """Level [dB] of an intensity; -inf of none."""
    return 10.0 * math.log10(intensity) if intensity > 0.0 else -math.inf
