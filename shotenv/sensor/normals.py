"""Standard normals as a function of (seed, frame, sample, tap, pixel), computed in compiled loops.

Philox-4x32-10 (Salmon, Moraes, Dror, Shaw, Parallel Random Numbers: As Easy as 1, 2, 3, 2011)
turns a counter and a key into four random words, which passes the usual batteries of tests for
counters and keys that merely count up. The key is the seed; the counter names the pixel, the pair
of samples, the frame and what the numbers are for. Box and Muller's transform (1958) makes a pair
of normals of each two words: those of tap A and tap B of one sample.

Nothing is drawn in an order, so no generator is seeded, kept or waited for. Words are integers, and
normals are sums, products and square roots of float32 numbers: every machine has the same bits.
"""

from __future__ import annotations

import numpy as np

from unwrap.support import inlined, loop

Array = np.ndarray
ROUNDS = 10
MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
KEY_STEPS = np.uint32(0x9E3779B9), np.uint32(0xBB67AE85)
"""Constants of Philox-4x32."""
HALF_WORD = np.uint64(32)
BLOCK = 1024
"""Pixels whose words are made before they become normals: few enough to stay in the processor's
first cache. Two loops, because one alone is too long to be turned into vector instructions."""

ONE, HALF, QUARTER, MINUS_TWO = map(np.float32, (1.0, 0.5, 0.25, -2.0))
LN_2 = np.float32(np.log(2.0))
ROOT_HALF_BITS = np.int32(np.float32(np.sqrt(0.5)).view(np.int32))
MANTISSA_BITS = np.int32(23)
TURN_PER_WORD = np.float32(2.0**-32)
LOG = tuple(
    map(
        np.float32,
        (
            *(7.0376836292e-2, -1.1514610310e-1, 1.1676998740e-1, -1.2420140846e-1),
            *(1.4249322787e-1, -1.6668057665e-1, 2.0000714765e-1, -2.4999993993e-1),
            3.3333331174e-1,
        ),
    )
)
"""Polynomial of `log_word`, highest power first (S. L. Moshier, Cephes, logf)."""
SINE = tuple(
    np.float32((-1.0) ** k * (2.0 * np.pi) ** (2 * k + 1) / np.prod(np.arange(1.0, 2 * k + 2)))
    for k in range(6)
)
"""Taylor series of sin(2 pi t); exact to float32 for a quarter turn."""


@inlined
def log_word(word):
    """ln((word // 2 + 1/2) / 2^31): of a uniform number between 0 and 1, neither of which it is."""
    # The last bit is given up, so that the number fits a signed integer, which processors convert.
    number = np.float32(np.int32(word >> np.uint32(1))) + HALF
    bits = np.float32(number).view(np.int32)
    # number = mantissa 2^exponent with a mantissa from sqrt(1/2) to sqrt(2), around 1.
    exponent = np.int32(np.int32(bits - ROOT_HALF_BITS) >> MANTISSA_BITS)
    mantissa = np.int32(bits - np.int32(exponent << MANTISSA_BITS)).view(np.float32)
    f = mantissa - ONE
    series = LOG[0]
    series = series * f + LOG[1]
    series = series * f + LOG[2]
    series = series * f + LOG[3]
    series = series * f + LOG[4]
    series = series * f + LOG[5]
    series = series * f + LOG[6]
    series = series * f + LOG[7]
    series = series * f + LOG[8]
    squared = f * f
    log_mantissa = f + (squared * f * series - HALF * squared)
    return log_mantissa + np.float32(np.int32(exponent - np.int32(31))) * LN_2


@inlined
def sine_of_turn(turn):
    """sin(2 pi turn), of at most a quarter turn to each side."""
    squared = turn * turn
    series = SINE[5]
    series = series * squared + SINE[4]
    series = series * squared + SINE[3]
    series = series * squared + SINE[2]
    series = series * squared + SINE[1]
    return (series * squared + SINE[0]) * turn


@inlined
def normal_pair(first, second):
    """Two independent standard normals of two random words (Box and Muller).

    They lie at the distance sqrt(-2 ln u) from 0, at most 6.7, in a uniform direction.
    """
    radius = np.sqrt(MINUS_TWO * log_word(first))
    turn = np.float32(np.int32(second)) * TURN_PER_WORD
    # cos(2 pi t) = sin(2 pi (1/4 - |t|)), and from that the sine but for its sign.
    from_side = QUARTER - abs(turn)
    sine = np.copysign(sine_of_turn(QUARTER - abs(from_side)), turn)
    return radius * sine_of_turn(from_side), radius * sine


@loop
def fill_normals_(
    purpose: int, seeds: Array, frames: Array, pair: int, words: Array, normals: Array
) -> None:
    """Normals of both taps of the samples 2 `pair` and 2 `pair` + 1.

    Parameters
    ----------
    purpose : int
        What the numbers are for: each purpose has its own.
    seeds, frames : int64 [B]
        Their lowest 64 and 32 bits count.
    words : uint32 [4, BLOCK]
        Space for words, as large as that whatever the number of pixels.
    normals : float32 [2, B, 2, P]
        Of sample, frame, tap and pixel; are written.
    """
    pixels = normals.shape[3]
    for b in range(len(seeds)):
        seed = np.uint64(seeds[b])
        for start in range(0, pixels, BLOCK):
            count = min(BLOCK, pixels - start)
            w0, w1, w2, w3 = words[0], words[1], words[2], words[3]
            for j in range(count):
                x0, x1, x2 = np.uint32(start + j), np.uint32(pair), np.uint32(frames[b])
                x3 = np.uint32(purpose)
                k0, k1 = np.uint32(seed), np.uint32(seed >> HALF_WORD)
                for _ in range(ROUNDS):
                    p0 = MULTIPLIERS[0] * np.uint64(x0)
                    p1 = MULTIPLIERS[1] * np.uint64(x2)
                    x0 = np.uint32(np.uint32(p1 >> HALF_WORD) ^ x1 ^ k0)
                    x2 = np.uint32(np.uint32(p0 >> HALF_WORD) ^ x3 ^ k1)
                    x1, x3 = np.uint32(p1), np.uint32(p0)
                    k0, k1 = np.uint32(k0 + KEY_STEPS[0]), np.uint32(k1 + KEY_STEPS[1])
                w0[j], w1[j], w2[j], w3[j] = x0, x1, x2, x3
            for sample in range(2):
                first, second = words[2 * sample], words[2 * sample + 1]
                tap_a = normals[sample, b, 0, start : start + count]
                tap_b = normals[sample, b, 1, start : start + count]
                for j in range(count):
                    tap_a[j], tap_b[j] = normal_pair(first[j], second[j])
