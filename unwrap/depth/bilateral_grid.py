"""Votes of neighbours over distances, counted in a bilateral grid; compiled.

J. Chen, S. Paris, F. Durand, Real-time Edge-aware Image Processing with the Bilateral Grid, ACM
Transactions on Graphics 26 (2007): beside the two axes of the image the grid has one of distances.
Votes are splatted into it, blurred, and read where they are wanted (sliced). Here that is no
approximation: the kernel over distances, a Gaussian of variance s^2, is the convolution of two of
variance s^2 / 2, one to splat with and one to slice with, and the sum over bins in place of the
integral errs by the share 2 exp(-pi^2 s^2 / (2 bin^2)) of it, 2e-6 for bins of 0.6 s.
"""

from __future__ import annotations

import math

import numpy as np

from unwrap.support import inlined, loop

Array = np.ndarray
BIN_PER_KERNEL = 0.6
"""Width of a bin in standard deviations of the kernel over distances."""
REACH = 6
"""A hypothesis is splatted into so many bins to either side of its own."""
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, ONE, TWO = np.float32(0.0), np.float32(1.0), np.float32(2.0)
LEAST_VOTE = np.float32(1e-20)
"""Lighter hypotheses do not vote: the tails of their Gaussians would be subnormal numbers, with
which a processor calculates about ten times slower, and which no other vote is small enough for."""
SHARPNESS = np.float32(BIN_PER_KERNEL**2)
"""The Gaussian that splats and slices, n bins away, is exp(-SHARPNESS n^2)."""
G1, G2, G3, G4, G5, G6 = (
    np.float32(math.exp(-(BIN_PER_KERNEL**2) * n * n)) for n in range(1, REACH + 1)
)
NORM = np.float32(math.sqrt(2 / math.pi) * BIN_PER_KERNEL)
"""Makes the sum over bins of the product of two such Gaussians 1 where both are at one place."""
# Coefficients of the Taylor series of the exponential function.
E2, E3, E4, E5, E6, E7 = (np.float32(1 / math.factorial(n)) for n in range(2, 8))


@inlined
def small_exp(x):
    """exp(x) for |x| <= 0.36, to the rounding of a float."""
    return ONE + x * (ONE + x * (E2 + x * (E3 + x * (E4 + x * (E5 + x * (E6 + x * E7))))))


@inlined
def place_in_bins(
    depth_m: Array,
    bins_per_m: np.float32,
    first_bin: int,
    bins: Array,
    at_bin: Array,
    rise: Array,
    fall: Array,
) -> None:
    """Bins of a row of distances, and the Gaussian around each, all [W].

    n bins above (below) its own it is `at_bin` `rise`^n exp(-SHARPNESS n^2), below with `fall`.
    """
    for j in range(len(depth_m)):
        place = depth_m[j] * bins_per_m
        middle = np.rint(place)
        bins[j] = np.int64(middle) - first_bin
        rise[j] = place - middle
    for j in range(len(depth_m)):
        beside = rise[j]
        at_bin[j] = small_exp(-SHARPNESS * beside * beside)
        rise[j] = small_exp(TWO * SHARPNESS * beside)
        fall[j] = small_exp(-TWO * SHARPNESS * beside)


@loop
def blur_(
    total: Array,
    left1: Array,
    right1: Array,
    left2: Array,
    right2: Array,
    left3: Array,
    right3: Array,
    first: np.float32,
    second: np.float32,
    third: np.float32,
    adds: bool,
) -> None:
    """`total` becomes, or gains, three weighted sums of two neighbours each; all [n]."""
    # Six at once: with more the compiler gives up proving that what is written is not read.
    if adds:
        for i in range(len(total)):
            total[i] += (
                first * (left1[i] + right1[i])
                + second * (left2[i] + right2[i])
                + third * (left3[i] + right3[i])
            )
    else:
        for i in range(len(total)):
            total[i] = (
                first * (left1[i] + right1[i])
                + second * (left2[i] + right2[i])
                + third * (left3[i] + right3[i])
            )


@loop
def vote_pixels(
    depth_m: Array,
    weight: Array,
    pair_weights: Array,
    bins_per_m: np.float32,
    first_bin: int,
    bins: int,
    least_weight: np.float32,
    density: Array,
) -> None:
    """Density of the neighbours' hypotheses at a pixel's own, see `kernel_density`.

    Parameters
    ----------
    depth_m, weight : float32 [B, I, H, W]
        Finite.
    pair_weights : float32 [3 n]
        Weight of the two neighbours 0, 1, 2, ... pixels away along a row or a column; of the pixel
        itself half, since it is counted as a pair, too.
    bins_per_m, first_bin, bins
        Bins that hold all distances and `REACH` more on both sides.
    density : float32 [B, I, H, W]
        Is written.
    """
    frames, count, rows, columns = depth_m.shape
    reach = len(pair_weights) - 1
    held, span, middle = 2 * reach + 1, columns * bins, reach * bins
    # A pixel's bins lie side by side; bin 0, which no hypothesis reaches, holds its whole weight.
    # Of rows blurred along themselves only those are held that one pixel's window needs.
    splatted = np.zeros(span + 2 * middle, np.float32)
    blurred, votes = np.zeros((held, span), np.float32), np.zeros(span, np.float32)
    place = np.zeros(columns, np.int64)
    at_bin, rise, fall = np.zeros((3, columns), np.float32)
    for b in range(frames):
        blurred[:] = ZERO
        for below in range(rows + reach):
            row = blurred[below % held]
            if below >= rows:
                row[:] = ZERO
            else:
                splatted[:] = ZERO
                for h in range(count):
                    place_in_bins(
                        depth_m[b, h, below], bins_per_m, first_bin, place, at_bin, rise, fall
                    )
                    row_weight = weight[b, h, below]
                    for j in range(columns):
                        own = row_weight[j]
                        if own > LEAST_VOTE:
                            start = middle + j * bins
                            splatted[start] += own
                            window = splatted[start + place[j] - REACH : start + place[j] + 7]
                            up, down = rise[j], fall[j]
                            above = beneath = own * at_bin[j]
                            window[6] += above
                            above, beneath = above * up, beneath * down
                            window[7] += above * G1
                            window[5] += beneath * G1
                            above, beneath = above * up, beneath * down
                            window[8] += above * G2
                            window[4] += beneath * G2
                            above, beneath = above * up, beneath * down
                            window[9] += above * G3
                            window[3] += beneath * G3
                            above, beneath = above * up, beneath * down
                            window[10] += above * G4
                            window[2] += beneath * G4
                            above, beneath = above * up, beneath * down
                            window[11] += above * G5
                            window[1] += beneath * G5
                            above, beneath = above * up, beneath * down
                            window[12] += above * G6
                            window[0] += beneath * G6
                for t in range(0, reach + 1, 3):
                    one, two, three = t * bins, (t + 1) * bins, (t + 2) * bins
                    blur_(
                        row,
                        splatted[middle - one : middle - one + span],
                        splatted[middle + one : middle + one + span],
                        splatted[middle - two : middle - two + span],
                        splatted[middle + two : middle + two + span],
                        splatted[middle - three : middle - three + span],
                        splatted[middle + three : middle + three + span],
                        pair_weights[t],
                        pair_weights[t + 1],
                        pair_weights[t + 2],
                        t > 0,
                    )
            i = below - reach
            if i < 0:
                continue
            # Rows above the image have places that still hold 0, rows below it were set to 0.
            for t in range(0, reach + 1, 3):
                blur_(
                    votes,
                    blurred[(i - t) % held],
                    blurred[(i + t) % held],
                    blurred[(i - t - 1) % held],
                    blurred[(i + t + 1) % held],
                    blurred[(i - t - 2) % held],
                    blurred[(i + t + 2) % held],
                    pair_weights[t],
                    pair_weights[t + 1],
                    pair_weights[t + 2],
                    t > 0,
                )
            for h in range(count):
                place_in_bins(depth_m[b, h, i], bins_per_m, first_bin, place, at_bin, rise, fall)
                found = density[b, h, i]
                for j in range(columns):
                    start = j * bins
                    window = votes[start + place[j] - REACH : start + place[j] + 7]
                    # By Horner's rule, from the farthest bin inwards.
                    up, down = rise[j], fall[j]
                    above = up * (G4 * window[10] + up * (G5 * window[11] + up * G6 * window[12]))
                    above = up * (G2 * window[8] + up * (G3 * window[9] + above))
                    above = up * (G1 * window[7] + above)
                    beneath = down * (G5 * window[1] + down * G6 * window[0])
                    beneath = down * (G3 * window[3] + down * (G4 * window[2] + beneath))
                    beneath = down * (G1 * window[5] + down * (G2 * window[4] + beneath))
                    share = NORM * at_bin[j] * (window[6] + above + beneath)
                    # Rounding may take it beyond the whole.
                    found[j] = min(share / max(votes[start], least_weight), ONE)
