"""What happens to light in a pixel, effect by effect, and the loops over pixels that compose them.

Each effect is a function of numbers; a parameter at zero (or an infinite full well) switches it
off. Electrons are counted over both taps unless a tap is named. Numbers are float32 throughout,
constants too: one Python float would make the arithmetic float64 (see `unwrap.support.loop`).
"""

from __future__ import annotations

from math import erfc
from typing import NamedTuple

import numpy as np

from unwrap.support import inlined, loop

Array = np.ndarray
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
ROOT_HALF, ROOT_TWO_PI = np.float32(np.sqrt(0.5)), np.float32(np.sqrt(2 * np.pi))
FAR, TINY_E = np.float32(6.0), np.float32(1e-3)
"""Standard deviations from the full well at which a charge no longer feels it."""


class IncidentLight(NamedTuple):
    """Noise-free light of B frames, and what it is worth in electrons of one sample, float32.

    Attributes
    ----------
    correlation : [B, 8, H, W]
    active, ambient : [B, H, W]
        As in `Exposure`.
    active_e, ambient_e : [B]
        As in `Sensitivity`; `active_e` is that of the correlation, too.
    """

    correlation: Array
    active: Array
    ambient: Array
    active_e: Array
    ambient_e: Array


class Pixel(NamedTuple):
    """Constants of the pixels of a sensor, float32.

    Attributes
    ----------
    contrast
        Demodulation contrast m.
    read_variance_e
        Variance of reading one tap, electrons squared.
    full_well_e
        Most that a tap can hold.
    gain_lsb_per_e
        Converter gain.
    ambient_lsb_per_e
        Offset that ambient light adds, of opposite sign in even and odd rows of the imager.
    low_lsb, high_lsb
        Samples of the lowest and the highest word.
    shot_noise
        1, or 0 where a full well is to clip a charge that does not fluctuate.
    """

    contrast: np.float32
    read_variance_e: np.float32
    full_well_e: np.float32
    gain_lsb_per_e: np.float32
    ambient_lsb_per_e: np.float32
    low_lsb: np.float32
    high_lsb: np.float32
    shot_noise: np.float32 = ONE


@inlined
def packet_e(charge_e, read_variance_e):
    """A tap's charge, not negative, plus the variance of reading it: the variance of both.

    Poisson's variance equals its mean. The difference of two packets is that of their charges. A
    charge may come out negative where a sample's light differs from the frame's mean.
    """
    return max(charge_e, ZERO) + read_variance_e


@inlined
def noisy_e(packet_e, normal):
    """Shot and read noise added to a packet, which is its own variance, by one standard normal.

    The normal distribution stands for Poisson's: one variate per packet keeps the noise stream
    in step whatever the light is.
    """
    return packet_e + normal * np.sqrt(packet_e)


@inlined
def clipped_e(charge_e, normal, pixel):
    """A tap near its full well as it is read, by one standard normal; see `packet_e`.

    A charge of mean q and variance q is cut off at the full well, then read. Mean and variance of
    the cut normal distribution have closed forms in d, the distance from q to the full well in
    standard deviations s, with its density p and distribution P there: the mean loses
    s (p - d (1 - P)), the variance becomes s^2 ((1 + d^2) P + d p - (p + d P)^2).
    """
    # Not 0, which would make 0 / 0 of a charge that just fills the tap.
    deviation_e = max(pixel.shot_noise * np.sqrt(charge_e), TINY_E)
    d = min(max((pixel.full_well_e - charge_e) / deviation_e, -FAR), FAR)
    density = np.float32(np.exp(-HALF * d * d)) / ROOT_TWO_PI
    # `erfc` and not 1 - P, which would be lost in rounding.
    above = HALF * np.float32(erfc(d * ROOT_HALF))
    below = HALF * np.float32(erfc(-d * ROOT_HALF))
    short = density + d * below
    spread = max((ONE + d * d) * below + d * density - short * short, ZERO)
    # Beyond `FAR` nothing is lost, or all that the full well does not hold.
    lost_e = max(deviation_e * (density - d * above), charge_e - pixel.full_well_e)
    variance_e = deviation_e * deviation_e * spread + pixel.read_variance_e
    return charge_e - lost_e + pixel.read_variance_e + normal * np.sqrt(variance_e)


@inlined
def word_lsb(analogue_lsb, low_lsb, high_lsb):
    """What the converter makes of its input: rounded half to even, clipped to its range."""
    return min(max(np.rint(analogue_lsb), low_lsb), high_lsb)


@inlined
def ambient_offset_lsb(ambient_e, full_well_e, lsb_per_e):
    """Offset that ambient light adds, linear until it alone fills both taps, and no more."""
    return lsb_per_e * min(ambient_e, full_well_e + full_well_e)


@loop
def take_sample_(
    number: int,
    light: IncidentLight,
    normals: Array,
    pattern_lsb: Array,
    parity: Array,
    pixel: Pixel,
    dcs_lsb: Array,
    saturated: Array,
) -> None:
    """Sample `number` of B frames: taps, noise, full well, difference, converter.

    The taps hold `(S + B +- m C) / 2`. Read noise may take a tap below zero. A full well cuts off
    the fluctuations of the charge, but not the noise of reading it.

    Parameters
    ----------
    number : int
        0..7.
    normals : float32 [B, 2, H, W]
        Standard normals of tap A and tap B.
    pattern_lsb : float32 [B, H, W]
        Fixed offset of each pixel.
    parity : float32 [H, W]
        1 or -1, the sign of the offset that ambient light adds.
    dcs_lsb : float32 [B, n, H, W]
        The sample is written into it.
    saturated : bool [B, H, W]
        Becomes true where a tap is full or the word at a limit of its range.
    """
    # Packets carry the variance of reading them; it cancels in the difference of two taps, and
    # the full well is raised by as much.
    full_e = pixel.full_well_e + pixel.read_variance_e
    # Charges up to here do not feel the full well; those above are found by their noisy packets,
    # which lie no lower than `near_e`.
    reach_e = FAR * np.sqrt(pixel.full_well_e)
    free_e, near_e = pixel.full_well_e - reach_e, full_e - reach_e - reach_e
    frames, rows, columns = saturated.shape
    for b in range(frames):
        active_e, ambient_e = light.active_e[b], light.ambient_e[b]
        # Half of the contrast in each tap: what one gains the other loses.
        swing_e = HALF * pixel.contrast * active_e
        for i in range(rows):
            sign = parity[i]
            active, ambient = light.active[b, i], light.ambient[b, i]
            correlation, pattern = light.correlation[b, number, i], pattern_lsb[b, i]
            normal_a, normal_b = normals[b, 0, i], normals[b, 1, i]
            words, full = dcs_lsb[b, number, i], saturated[b, i]
            near = False
            for j in range(columns):
                background_e = ambient[j] * ambient_e
                mean_e = HALF * (active[j] * active_e + background_e)
                half_e = correlation[j] * swing_e
                a_e = noisy_e(packet_e(mean_e + half_e, pixel.read_variance_e), normal_a[j])
                b_e = noisy_e(packet_e(mean_e - half_e, pixel.read_variance_e), normal_b[j])
                offset_lsb = pattern[j] + sign[j] * ambient_offset_lsb(
                    background_e, pixel.full_well_e, pixel.ambient_lsb_per_e
                )
                word = word_lsb(
                    offset_lsb + pixel.gain_lsb_per_e * (a_e - b_e), pixel.low_lsb, pixel.high_lsb
                )
                words[j] = word
                # The lowest and the highest word report overflow, as those of real imagers do.
                full[j] = full[j] | (
                    (a_e >= full_e)
                    | (b_e >= full_e)
                    | (word <= pixel.low_lsb)
                    | (word >= pixel.high_lsb)
                )
                near |= (a_e >= near_e) | (b_e >= near_e)
            if not near:
                continue
            # A loop of its own for rows with charges that feel the full well: what they need keeps
            # a loop from vector instructions.
            for j in range(columns):
                background_e = ambient[j] * ambient_e
                mean_e = HALF * (active[j] * active_e + background_e)
                half_e = correlation[j] * swing_e
                if mean_e + abs(half_e) > free_e:
                    a_e = clipped_e(max(mean_e + half_e, ZERO), normal_a[j], pixel)
                    b_e = clipped_e(max(mean_e - half_e, ZERO), normal_b[j], pixel)
                    offset_lsb = pattern[j] + sign[j] * ambient_offset_lsb(
                        background_e, pixel.full_well_e, pixel.ambient_lsb_per_e
                    )
                    words[j] = word_lsb(
                        offset_lsb + pixel.gain_lsb_per_e * (a_e - b_e),
                        pixel.low_lsb,
                        pixel.high_lsb,
                    )


@loop
def take_gray_(
    ambient: Array, per_light_e: Array, normals: Array, pixel: Pixel, words: Array
) -> None:
    """Gray words of B frames: one tap, noise, full well, converter.

    Parameters
    ----------
    ambient, normals : float32 [B, H, W]
    per_light_e : float32 [B]
        Electrons per ambient radiance.
    words : integer [B, H, W]
        Are written.
    """
    frames, rows, columns = words.shape
    for b in range(frames):
        for i in range(rows):
            for j in range(columns):
                charge_e = ambient[b, i, j] * per_light_e[b]
                read_e = noisy_e(packet_e(charge_e, pixel.read_variance_e), normals[b, i, j])
                # No second tap cancels the variance that the packet carries.
                held_e = min(read_e - pixel.read_variance_e, pixel.full_well_e)
                words[b, i, j] = word_lsb(
                    held_e * pixel.gain_lsb_per_e, pixel.low_lsb, pixel.high_lsb
                )


@loop
def mark_scored_(
    light: IncidentLight,
    pixel: Pixel,
    truth_m: Array,
    range_m: np.float32,
    snr: np.float32,
    scored: Array,
) -> None:
    """Where truth lies within a range and one sample's noise-free signal to noise is above `snr`.

    `m S / sqrt(S + B + 2 sigma_r^2)`.

    Parameters
    ----------
    truth_m : float32 [B, H, W]
    scored : bool [B, H, W]
        Is written.
    """
    # Of both taps, whose difference the sample is.
    both_e = pixel.read_variance_e + pixel.read_variance_e
    frames, rows, columns = scored.shape
    for b in range(frames):
        for i in range(rows):
            for j in range(columns):
                active_e = light.active[b, i, j] * light.active_e[b]
                ambient_e = light.ambient[b, i, j] * light.ambient_e[b]
                noise_e = np.sqrt(active_e + ambient_e + both_e)
                above = pixel.contrast * active_e > snr * noise_e
                scored[b, i, j] = above & (truth_m[b, i, j] <= range_m)


@loop
def noise_by_gray_(
    gray: Array,
    variance_per_word: Array,
    dark: np.float32,
    offset_variance: Array,
    offset_per_word: Array,
    most_offset: np.float32,
    noise: Array,
) -> None:
    """Noise of a sample in the light that a gray image shows, and offset that counts as noise.

    Parameters
    ----------
    gray : integer [B, H, W]
    variance_per_word : float32 [B]
        Of a sample, per word of the gray image.
    dark : float32
        Variance of a sample without light.
    offset_variance, offset_per_word : float32 [B]
        Variance of the offset, and offset that ambient light adds per word of the gray image; 0
        where offsets cancel.
    most_offset : float32
        Where ambient light fills the taps.
    noise : float32 [B, H, W]
        Standard deviation; is written.
    """
    frames, rows, columns = noise.shape
    for b in range(frames):
        for i in range(rows):
            for j in range(columns):
                word = np.float32(gray[b, i, j])
                offset = min(word * offset_per_word[b], most_offset)
                known = word * variance_per_word[b] + dark
                # Twice: an offset stands in both samples, and lengthens them in one direction as
                # noise of that variance would in both.
                offsets = offset_variance[b] + offset * offset
                noise[b, i, j] = np.sqrt(known + offsets + offsets)
