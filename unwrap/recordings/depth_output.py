"""What is written of a corrected frame: maps, an image in millimetres, points, a picture."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch

from unwrap.depth import focal_px, points_of
from unwrap.recordings.camera import Camera
from unwrap.recordings.depth_picture import draw_frame
from unwrap.recordings.frame_correction import CorrectedFrame
from unwrap.recordings.images import HIGHEST_MM, depth_png, whole_millimetres
from unwrap.recordings.pcd import encode_pcd
from unwrap.ros import McapLog
from unwrap.support import write_bytes

Points = Literal["ply", "pcd"]
"""Format of the points of a frame."""


def output_files(points: Points) -> tuple[str, ...]:
    """Names of the files of one frame."""
    return ("depth_m.npy", "valid.npy", "depth_mm.png", f"points.{points}", "picture.png")


def refuse_overwriting(
    names: Sequence[str], out: Path, *, points: Points = "ply", mcap: Path | None = None
) -> None:
    """Check that no file stands where `write_frames` would write frames of these names, or `mcap`.

    Raises
    ------
    ValueError
        One stands already; the message names it.
    """
    # All frames at once: half a recording written would be worse than none.
    files = [out / name / file for name in names for file in output_files(points)]
    for path in files if mcap is None else (*files, mcap):
        if path.exists():
            raise ValueError(f"{path} stands already; --overwrite replaces it")


def write_frames(
    frames: Sequence[CorrectedFrame],
    camera: Camera,
    out: Path,
    *,
    points: Points = "ply",
    log: McapLog | None = None,
    times_s: Sequence[float] | None = None,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Write the files of every frame, into a folder each where there are several.

    Parameters
    ----------
    points : "ply" or "pcd"
        Format of the points.
    log : McapLog, optional
        Takes every frame, too.
    times_s : sequence of float, optional
        When each frame was recorded, for the log.
    tick : callable
        Called after each frame.

    Returns
    -------
    dict
        `shots`, `merge`, `eight`, and of each of the `frames` its `folder` and `frame_statistics`.
    """
    numbers = []
    for number, frame in enumerate(frames):
        # The frame of a recording without an axis of frames is named "": it lies in `out` itself.
        folder = out / frame.recording.names[0]
        for name, content in encode_frame(frame, camera, points).items():
            write_bytes(folder / name, content)
        if log is not None:
            cloud, valid = organised_cloud(frame, camera), frame.depth.valid[0].numpy()
            time_s = None if times_s is None else times_s[number]
            # REP 118: along the axis of the camera, not along the ray of the pixel.
            log.add(whole_millimetres(cloud[..., 0], valid), cloud, time_s=time_s)
        numbers.append({"folder": str(folder), **frame_statistics(frame)})
        tick()
    shots = int(frames[0].recording.raw.shots)
    return {"shots": shots, "merge": camera.merge, "eight": camera.eight, "frames": numbers}


def encode_frame(frame: CorrectedFrame, camera: Camera, points: Points) -> dict[str, bytes]:
    """Content of the files of one frame, by their names in `output_files`."""
    depth_m, valid = frame.depth.distance_m[0].numpy(), frame.depth.valid[0].numpy()
    picture = io.BytesIO()
    draw_frame(frame, camera.description).save(picture, format="PNG")
    encoded = (
        _npy(depth_m.astype(np.float32)),
        _npy(valid),
        depth_png(depth_m, valid),
        ENCODERS[points](frame, camera),
        picture.getvalue(),
    )
    return dict(zip(output_files(points), encoded, strict=True))


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


def view_points(frame: CorrectedFrame, camera: Camera) -> torch.Tensor:
    """What the pixels see, metres ahead, left and up, float64 [3, H, W]."""
    distance_m = frame.depth.distance_m.double()
    if camera.rays is not None:
        return camera.rays * distance_m
    return points_of(distance_m, focal_px(distance_m.shape[-1], camera.horizontal_fov_deg))[:, 0]


def point_cloud(frame: CorrectedFrame, camera: Camera) -> bytes:
    """Binary little-endian PLY of the valid pixels: metres ahead, left and up, gray as colour."""
    import trimesh  # Here: it takes long to load, and only this needs it.

    valid = frame.depth.valid[0]
    points = view_points(frame, camera)[:, valid].T
    colors = None
    if frame.recording.gray is not None:
        # Four channels, the last opaque: trimesh colours have no other form.
        level = (frame.recording.gray[0][valid] * 255).round().byte().numpy()
        colors = np.stack([level, level, level, np.full_like(level, 255)], axis=-1)
    return trimesh.PointCloud(points.numpy(), colors=colors).export(file_type="ply")


def organised_cloud(frame: CorrectedFrame, camera: Camera) -> np.ndarray:
    """Points and intensity float32 [H, W, 4]: metres ahead, left and up, amplitude in LSB.

    NaN where not valid.
    """
    depth = frame.depth
    maps = torch.cat((view_points(frame, camera).float(), depth.amplitude))
    return maps.where(depth.valid, torch.nan).movedim(0, -1).numpy()


def pcd_cloud(frame: CorrectedFrame, camera: Camera) -> bytes:
    """Binary PCD of the valid pixels: metres ahead, left and up, amplitude as intensity."""
    return encode_pcd(organised_cloud(frame, camera)[frame.depth.valid[0].numpy()])


ENCODERS: Mapping[Points, Callable[[CorrectedFrame, Camera], bytes]] = {
    "ply": point_cloud,
    "pcd": pcd_cloud,
}
"""Of points, by the name that the command line uses and the file's name ends with."""
