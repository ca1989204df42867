"""From light to scores in one compiled loop, frame by frame: what a step spends its time in."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from shotenv.decision.score import SCORES, score_pixels_, sum_pixels_
from shotenv.sensor import (
    BLOCK,
    GrayNoise,
    IncidentLight,
    Pixel,
    Purpose,
    fill_normals_,
    mark_scored_,
    noise_by_gray_,
    take_sample_,
)
from unwrap.depth import DualLimits, Limits, fuse_pixels, merge_pixels
from unwrap.signal import TurnsTable, angle_pixels, decode_pixels
from unwrap.support import loop, source_stamp

Array = np.ndarray
NOISE = int(Purpose.NOISE)


class FramesTaken(NamedTuple):
    """What differs from frame to frame of a batch; maps are [B, H, W].

    Attributes
    ----------
    shots, seeds, steps : int64 [B]
        Samples taken, 0, 2, 4 or 8; what the noise is drawn by.
    light : IncidentLight
        With the drives' own laser power.
    emitted_e : float32 [B]
        As `light.active_e`, with the power that is emitted.
    truth_m, gray, predicted_m, pattern_lsb, calibrated_lsb
        True distance; words of the gray image; the network's distance; offset, and what is stored.
    noise_of_two, noise_of_more : GrayNoise
        Of a sample among two, and among more.
    shift1, shift2 : float32 [B]
        Turns that are added at f1 and f2.
    """

    shots: Array
    seeds: Array
    steps: Array
    light: IncidentLight
    emitted_e: Array
    truth_m: Array
    gray: Array
    predicted_m: Array
    pattern_lsb: Array
    calibrated_lsb: Array
    noise_of_two: GrayNoise
    noise_of_more: GrayNoise
    shift1: Array
    shift2: Array


class Chain(NamedTuple):
    """Constants of the way from light to scores.

    Attributes
    ----------
    parity, pixel, range_m, min_snr
        Of the sensor: see `take_sample_` and `mark_scored_`.
    table1, table2, limits, branch, dual
        Of the correction: see `merge_pixels` and `fuse_pixels`.
    fuses : bool
        Whether the frequencies of eight samples tell the wraps; else the prediction does.
    scale_m, near_m, worst_m
        Of the score: see `score_pixels_`.
    """

    parity: Array
    pixel: Pixel
    range_m: np.float32
    min_snr: np.float32
    table1: TurnsTable
    table2: TurnsTable
    limits: Limits
    branch: int
    dual: DualLimits
    fuses: bool
    scale_m: np.float32
    near_m: np.float32
    worst_m: float


class Room(NamedTuple):
    """Memory for the maps of one frame, each [1, H, W] but where told, and views of it.

    Views are made here and not in the loop, where they would take seconds to compile.

    Attributes
    ----------
    words, normals, normals_in_rows
        Random words; normals [2, 1, 2, H, W] of two samples, and as [2, 1, 2, H W].
    samples, of_two, of_four, at_f2
        Eight samples [1, 8, H, W]; the first two, the first four, the last four of them.
    cosine_row, sine_row, cosine2_row : [H W]
        `cosine`, `sine`, `cosine2`.
    maps, masks : [5, 1, H, W], [3, 1, H, W]
        Noise, amplitude and residual at f1, the latter at f2; saturated, scored, valid.
    distances : [3, 1, H, W]
        Of the first two, the first four and all samples.
    score, sums : [6, 1], [8, 1]
    """

    words: Array
    normals: Array
    normals_in_rows: Array
    samples: Array
    of_two: Array
    of_four: Array
    at_f2: Array
    no_offset: Array
    maps: Array
    cosine: Array
    sine: Array
    cosine2: Array
    cosine_row: Array
    sine_row: Array
    cosine2_row: Array
    distances: Array
    masks: Array
    score: Array
    sums: Array


def room_for(rows: int, columns: int) -> Room:
    """Memory for frames of `rows` x `columns` pixels."""
    one = (1, rows, columns)
    normals = np.empty((2, 1, 2, rows, columns), np.float32)
    samples = np.empty((1, 8, rows, columns), np.float32)
    cosine, sine, cosine2 = (np.empty(one, np.float32) for _ in range(3))
    return Room(
        words=np.empty((4, BLOCK), np.uint32),
        normals=normals,
        normals_in_rows=normals.reshape(2, 1, 2, -1),
        samples=samples,
        # Without copying: slices of the first axis lie in one piece.
        of_two=samples[0, :2][None],
        of_four=samples[0, :4][None],
        at_f2=samples[0, 4:][None],
        no_offset=np.zeros(one, np.float32),
        maps=np.empty((5, *one), np.float32),
        cosine=cosine,
        sine=sine,
        cosine2=cosine2,
        cosine_row=cosine.reshape(-1),
        sine_row=sine.reshape(-1),
        cosine2_row=cosine2.reshape(-1),
        distances=np.empty((3, 1, rows, columns), np.float32),
        masks=np.empty((3, *one), np.bool_),
        score=np.empty((len(SCORES), 1)),
        sums=np.empty((8, 1)),
    )


def _frame_loop(stamp: int) -> Callable[..., bool]:
    """The loop `score_frames_`; `stamp` is that of the loops that it calls."""

    @loop
    def score_frames_(
        begin: int,
        end: int,
        taken: FramesTaken,
        chain: Chain,
        room: Room,
        score: Array,
        error_of_four: Array,
        sums: Array,
    ) -> bool:
        """Acquire, correct and score frames, one after the other: all of one stays in the cache.

        The same loops in the same order as `acquire_depths`, `correct`, `score_depth` and
        `sums_of`, which keep the maps; a test holds them together to the last bit.

        Parameters
        ----------
        begin, end : int
            Frames of the batch that are worked on: threads share a batch.
        room : Room
            To write in; each thread has its own.
        score, error_of_four, sums : float64 [6, B], [B], [8, B]
            Fields of `DepthScore`, the error term of 4 DCS with an undiminished laser, and fields
            of `features.Sums` but the pixels. Written; score and sums not where no sample is taken.

        Returns
        -------
        bool
            Whether all samples are finite.
        """
        used_for_the_cache_of_numba = stamp  # noqa: F841
        finite = True
        saturated, scored, valid = room.masks[0], room.masks[1], room.masks[2]
        noise, amplitude, residual = room.maps[0], room.maps[1], room.maps[2]
        amplitude2, residual2 = room.maps[3], room.maps[4]
        cosine, sine, cosine2, distances = room.cosine, room.sine, room.cosine2, room.distances
        for b in range(begin, end):
            e = b + 1
            light, truth_m, shots = taken.light, taken.truth_m[b:e], taken.shots[b]
            derated = taken.emitted_e[b] != light.active_e[b]
            own = IncidentLight(
                light.correlation[b:e],
                light.active[b:e],
                light.ambient[b:e],
                light.active_e[b:e],
                light.ambient_e[b:e],
            )
            mark_scored_(own, chain.pixel, truth_m, chain.range_m, chain.min_snr, scored)
            # Once with what is emitted, and after that with the undiminished laser of the
            # reward's reference, if it differs.
            for derates in (True, False):
                if derates and not (derated and shots):
                    continue
                emitted_e = taken.emitted_e[b:e] if derates else light.active_e[b:e]
                lit = IncidentLight(
                    own.correlation, own.active, own.ambient, emitted_e, own.ambient_e
                )
                counts = derates or not derated
                saturated[:] = False
                for number in range(max(shots, 4) if counts else 4):
                    if number % 2 == 0:
                        fill_normals_(
                            NOISE,
                            taken.seeds[b:e],
                            taken.steps[b:e],
                            number // 2,
                            room.words,
                            room.normals_in_rows,
                        )
                    take_sample_(
                        number,
                        lit,
                        room.normals[number % 2],
                        taken.pattern_lsb[b:e],
                        chain.parity,
                        chain.pixel,
                        room.samples,
                        saturated,
                    )
                    count = number + 1
                    if count != 2 and count != 4 and count != 8:
                        continue
                    known = taken.noise_of_two if count == 2 else taken.noise_of_more
                    noise_by_gray_(
                        taken.gray[b:e],
                        known.variance_per_word[b:e],
                        known.dark,
                        known.offset_variance[b:e],
                        known.offset_per_word[b:e],
                        known.most_offset,
                        noise,
                    )
                    finite &= decode_pixels(
                        room.of_two if count == 2 else room.of_four,
                        # Two samples hold the offset; see `offset_to_subtract_lsb`.
                        taken.calibrated_lsb[b:e] if count == 2 else room.no_offset,
                        cosine,
                        sine,
                        amplitude,
                        residual,
                    )
                    angle_pixels(room.sine_row, room.cosine_row, room.cosine_row)
                    place = 0 if count == 2 else (1 if count == 4 else 2)
                    distance_m = distances[place]
                    merge_pixels(
                        cosine,
                        chain.table1,
                        taken.shift1[b:e],
                        amplitude,
                        noise,
                        saturated,
                        taken.predicted_m[b:e],
                        chain.limits,
                        chain.branch,
                        distance_m,
                        valid,
                    )
                    if count == 8 and chain.fuses:
                        finite &= decode_pixels(
                            room.at_f2,
                            room.no_offset,
                            cosine2,
                            sine,
                            amplitude2,
                            residual2,
                        )
                        angle_pixels(room.sine_row, room.cosine2_row, room.cosine2_row)
                        fuse_pixels(
                            cosine,
                            cosine2,
                            chain.table2,
                            taken.shift2[b:e],
                            amplitude2,
                            noise,
                            valid,
                            chain.dual,
                            distance_m,
                        )
                    is_reference = count == 4 and not derates
                    if not is_reference and not (counts and count == shots):
                        continue
                    score_pixels_(
                        distance_m,
                        valid,
                        truth_m,
                        scored,
                        chain.scale_m,
                        chain.near_m,
                        chain.worst_m,
                        room.score,
                    )
                    if is_reference:
                        error_of_four[b] = room.score[0, 0]
                    if counts and count == shots:
                        sum_pixels_(
                            amplitude,
                            amplitude if count == 2 else residual,
                            noise,
                            valid,
                            saturated,
                            distance_m,
                            distances[0],
                            distances[min(place, 1)],
                            chain.scale_m,
                            room.sums,
                        )
                        # One by one: assigning slices would take seconds to compile.
                        for k in range(len(score)):
                            score[k, b] = room.score[k, 0]
                        for k in range(len(sums)):
                            sums[k, b] = room.sums[k, 0]
        return finite

    return score_frames_


score_frames_ = _frame_loop(
    source_stamp(
        fill_normals_, take_sample_, decode_pixels, merge_pixels, fuse_pixels, score_pixels_
    )
)
