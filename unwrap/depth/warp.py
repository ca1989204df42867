"""Warping: depth of the previous frame, moved to where its points are seen now.

Axes are a vehicle's: x ahead along the camera's axis, y left, z up. A positive yaw turns left, so
that what is seen moves to the right, to higher columns. The camera is a pinhole with square pixels;
row 0 is the top, column 0 the left, and a pixel's ray goes through its centre.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from unwrap.signal import Memory


def move_depth(
    distance_m: Tensor,
    *,
    forward_m: Tensor | float,
    yaw_rad: Tensor | float,
    horizontal_fov_deg: float,
) -> Memory:
    """Depth of a still scene as it is seen after the camera has moved.

    Every pixel's point falls onto the nearest pixel of the new view, and the nearer of two points
    wins. What is behind the camera or outside the view is lost. Pixels that no point falls onto are
    unknown, but for holes a pixel wide, which open in surfaces that come nearer and are filled, see
    `bridge_holes`.

    Parameters
    ----------
    distance_m : float [B, H, W]
        Radial distances of the frame before, metres; NaN, infinite or 0 where nothing is known.
    forward_m : float or [B]
        Length of the camera's path since then, metres: an arc of constant turn, which begins along
        the camera's axis, and a straight line where `yaw_rad` is 0.
    yaw_rad : float or [B]
        Turn about the vertical since then, radians, positive to the left.
    horizontal_fov_deg : float
        Horizontal field of view.

    Returns
    -------
    Memory
        float32 [B, H, W].

    Raises
    ------
    ValueError
        `distance_m` is no floating-point [B, H, W], or the field of view is not within 0..180.
    """
    if distance_m.ndim != 3 or not distance_m.is_floating_point():
        found = f"{distance_m.dtype} {tuple(distance_m.shape)}"
        raise ValueError(f"distance_m is {found}; expected floating point [B, H, W]")
    if not 0 < horizontal_fov_deg < 180:
        raise ValueError(f"horizontal_fov_deg is {horizontal_fov_deg}; expected between 0 and 180")
    known = distance_m.isfinite() & (distance_m > 0)
    height, width = distance_m.shape[-2:]
    focal = focal_px(width, horizontal_fov_deg)
    points = points_of(torch.where(known, distance_m, 0), focal)
    # [1, 1, 1] or [B, 1, 1], of the type and on the device of the points.
    forward, yaw = (
        torch.as_tensor(value).to(points).reshape(-1, 1, 1) for value in (forward_m, yaw_rad)
    )
    ahead, left, up = to_new_camera(points, forward, yaw)
    column = ((width - 1) / 2 - focal * left / ahead).round()
    row = ((height - 1) / 2 - focal * up / ahead).round()
    seen = known & (ahead > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    place = torch.where(seen, row * width + column, 0).long()
    return splat(torch.stack((ahead, left, up)).square().sum(0).sqrt(), place, seen)


def focal_px(width: int, horizontal_fov_deg: float) -> float:
    """Focal length in pixels: half the image's width lies under half the field of view.

    Examples
    --------
    >>> round(focal_px(320, 90.0), 6)
    160.0
    """
    return width / 2 / math.tan(math.radians(horizontal_fov_deg) / 2)


def points_of(distance_m: Tensor, focal: float) -> Tensor:
    """Points [3, B, H, W], ahead, left and up, at radial distances [B, H, W]; see `focal_px`."""
    height, width = distance_m.shape[-2:]
    left = ((width - 1) / 2 - torch.arange(width).to(distance_m)) / focal
    up = ((height - 1) / 2 - torch.arange(height).to(distance_m)) / focal
    up = up.unsqueeze(1)
    ahead = distance_m / (1 + left.square() + up.square()).sqrt()
    return torch.stack((ahead, ahead * left, ahead * up))


def to_new_camera(points: Tensor, forward_m: Tensor, yaw_rad: Tensor) -> Tensor:
    """Points [3, ...] in the axes of a camera that went `forward_m` on an arc and turned by yaw.

    The chord of the arc has length forward sin(yaw / 2) / (yaw / 2) and the direction yaw / 2.

    Examples
    --------
    A point 5 m ahead, after 1 m straight on:

    >>> to_new_camera(torch.tensor([5.0, 0.0, 0.0]), torch.tensor(1.0), torch.tensor(0.0))
    tensor([4., 0., 0.])
    """
    ahead, left, up = points
    # torch's sinc has its own factor pi: sinc(x) = sin(pi x) / (pi x); it is 1 at yaw 0.
    chord_m = forward_m * torch.sinc(yaw_rad / (2 * math.pi))
    ahead, left = ahead - chord_m * (yaw_rad / 2).cos(), left - chord_m * (yaw_rad / 2).sin()
    cosine, sine = yaw_rad.cos(), yaw_rad.sin()
    return torch.stack((cosine * ahead + sine * left, cosine * left - sine * ahead, up))


def splat(distance_m: Tensor, place: Tensor, seen: Tensor) -> Memory:
    """The least of the distances [B, H, W] that are `seen` at each flat index `place`, as a map.

    Holes a pixel wide are bridged.
    """
    # A depth buffer. Points that are not seen are offered at infinity, where they never win.
    offered = torch.where(seen, distance_m, torch.inf).flatten(1)
    nearest = torch.full_like(offered, torch.inf)
    nearest = nearest.scatter_reduce(1, place.flatten(1), offered, "amin").view_as(distance_m)
    for axis in (-1, -2):
        nearest = bridge_holes(nearest, axis)
    known = nearest.isfinite()
    return Memory(torch.where(known, nearest, 0).float(), known.float())


def bridge_holes(distance_m: Tensor, axis: int) -> Tensor:
    """Fill infinite distances [B, H, W] with the nearer of both neighbours along `axis`, if known.

    Examples
    --------
    >>> bridge_holes(torch.tensor([[[4.0, torch.inf, 3.0, torch.inf]]]), -1)
    tensor([[[4., 3., 3., inf]]])
    """
    beyond = torch.full_like(distance_m.narrow(axis, 0, 1), torch.inf)
    padded = torch.cat((beyond, distance_m, beyond), axis)
    before, after = (padded.narrow(axis, at, distance_m.shape[axis]) for at in (0, 2))
    hole = before.isfinite() & after.isfinite() & ~distance_m.isfinite()
    return torch.where(hole, torch.minimum(before, after), distance_m)
