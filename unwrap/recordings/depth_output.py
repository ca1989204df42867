"""What is written of a corrected frame: maps, an image in millimetres, points, a picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from unwrap.depth import focal_px, points_of
from unwrap.recordings.camera import Camera
from unwrap.recordings.depth_picture import draw_frame
from unwrap.recordings.frame_correction import CorrectedFrame
from unwrap.recordings.images import HIGHEST_MM, depth_png
from unwrap.support import write_bytes

OUTPUT_FILES = ("depth_m.npy", "valid.npy", "depth_mm.png", "points.ply", "picture.png")
"""Names of the files of one frame."""


def refuse_overwriting(names: Sequence[str], out: Path) -> None:
    """Check that no file stands where `write_frames` would write one of the frames of these names.

    Raises
    ------
    ValueError
        One stands already; the message names it.
    """
    # All frames at once: half a recording written would be worse than none.
    for path in (out / name / file for name in names for file in OUTPUT_FILES):
        if path.exists():
            raise ValueError(f"{path} stands already; --overwrite replaces it")


def write_frames(
    frames: Sequence[CorrectedFrame],
    camera: Camera,
    out: Path,
    *,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Write the files of every frame, into a folder each where there are several.

    Parameters
    ----------
    tick : callable
        Called after each frame.

    Returns
    -------
    dict
        `shots`, `merge`, `eight`, and of each of the `frames` its `folder` and `frame_statistics`.
    """
    numbers = []
    for frame in frames:
        # The frame of a recording without an axis of frames is named "": it lies in `out` itself.
        folder = out / frame.recording.names[0]
        for name, content in encode_frame(frame, camera).items():
            write_bytes(folder / name, content)
        numbers.append({"folder": str(folder), **frame_statistics(frame)})
        tick()
    shots = int(frames[0].recording.raw.shots)
    return {"shots": shots, "merge": camera.merge, "eight": camera.eight, "frames": numbers}


def encode_frame(frame: CorrectedFrame, camera: Camera) -> dict[str, bytes]:
    """Content of the files of one frame, by their names in `OUTPUT_FILES`."""
    depth_m, valid = frame.depth.distance_m[0].numpy(), frame.depth.valid[0].numpy()
    picture = io.BytesIO()
    draw_frame(frame, camera.description).save(picture, format="PNG")
    encoded = (
        _npy(depth_m.astype(np.float32)),
        _npy(valid),
        depth_png(depth_m, valid),
        point_cloud(frame, camera),
        picture.getvalue(),
    )
    return dict(zip(OUTPUT_FILES, encoded, strict=True))


def _npy(array: np.ndarray) -> bytes:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    return content.getvalue()


def frame_statistics(frame: CorrectedFrame) -> dict[str, float | int | str]:
    """Shares of valid and saturated pixels, median distance, pixels beyond what a PNG holds, and
    the noise that decided what is valid."""
    distances = frame.depth.distance_m[frame.depth.valid]
    return {
        "valid_share": frame.depth.valid.double().mean().item(),
        "saturated_share": frame.recording.raw.saturated.double().mean().item(),
        "median_m": distances.median().item(),
        "pixels_beyond_png": int((distances * 1000 > HIGHEST_MM).sum()),
        "noise_lsb": frame.noise.noise_lsb.median().item(),
        "noise_source": frame.noise.source,
    }


def point_cloud(frame: CorrectedFrame, camera: Camera) -> bytes:
    """Binary little-endian PLY of the valid pixels: metres ahead, left and up, gray as colour."""
    import trimesh  # Here: it takes long to load, and only this needs it.

    valid, distance_m = frame.depth.valid[0], frame.depth.distance_m.double()
    if camera.rays is None:
        focal = focal_px(valid.shape[-1], camera.horizontal_fov_deg)
        points = points_of(distance_m, focal)[:, 0, valid].T
    else:
        points = (camera.rays * distance_m)[:, valid].T
    colors = None
    if frame.recording.gray is not None:
        # Four channels, the last opaque: trimesh colours have no other form.
        level = (frame.recording.gray[0][valid] * 255).round().byte().numpy()
        colors = np.stack([level, level, level, np.full_like(level, 255)], axis=-1)
    return trimesh.PointCloud(points.numpy(), colors=colors).export(file_type="ply")
