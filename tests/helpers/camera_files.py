"""Files as cameras write them, from a scene at known distances.

Everything here is written from the formats' own descriptions and imports nothing that reads them.
"""

from __future__ import annotations

import struct
from pathlib import Path

import h5py
import numpy as np
import yaml

C_M_S = 299_792_458.0
CONFIGS = Path(__file__).parents[2] / "configs" / "camera"
KINECT_SIZE = (424, 512)


def phasors(distance_m, frequencies_hz, amplitude):
    """Cosine and sine parts [2, K, H, W]."""
    phases = np.stack([4 * np.pi * hz * distance_m / C_M_S for hz in frequencies_hz])
    return amplitude * np.stack((np.cos(phases), np.sin(phases)))


def ordered(name, cosine, sine):
    """Planes [K, P, H, W] of one frame, in the order in which a camera stores them."""
    orders = {
        # phi = atan2(D3 - D1, D2 - D0) + pi
        "epc660": (cosine, sine, -cosine, -sine),
        "imx556": (cosine, sine, -cosine, -sine),
        # 0, 180, 90, 270 degrees, and the same with the other sign of the sine
        "mlx75027": (cosine, -cosine, sine, -sine),
        "mlx75027_reversed": (cosine, -cosine, -sine, sine),
        # phi = atan2(I3 - I1, I0 - I2) + pi
        "arducam_b0548": (-cosine, sine, cosine, -sine),
        # cos(phi + 2 pi k / 3)
        "kinect_v2": tuple(
            cosine * np.cos(2 * np.pi * k / 3) - sine * np.sin(2 * np.pi * k / 3) for k in range(3)
        ),
        "phasor_video": (cosine, sine),
    }
    return np.stack(orders[name], axis=1)


def planes(name, distances_m, frequencies_hz, *, amplitude=600.0, offset=0.0, noise=0.0, seed=0):
    """Planes [F, K, P, H, W] of frames of these distances [H, W]; floats, noise drawn."""
    frames = np.stack(
        [ordered(name, *phasors(one, frequencies_hz, amplitude)) for one in distances_m]
    )
    return frames + offset + noise * np.random.default_rng(seed).standard_normal(frames.shape)


def whole(frames):
    return np.rint(frames).astype(np.int32)


def write_espros(path, frames, *, image_type="DCS", mhz=24.0, times=None, dtype=np.int32):
    """Samples [N, 4, H, W] centred on zero, or images [N, H, W]."""
    with h5py.File(path, "w") as file:
        height, width = frames.shape[-2:]
        file.attrs["image_type"] = image_type
        file.attrs["roi"] = (0, 0, width, height)
        file.attrs["chipid"] = 123
        file.attrs["mod_frequency"] = mhz
        file["frames_0"] = frames.astype(dtype)
        file["timestamps"] = np.arange(len(frames)) * 0.1 if times is None else times


def wire_header(kind, width, height, *, low_us=400, centi_celsius=3150):
    return struct.pack(
        "!BHHHHHHHHHHhH",
        *(3, kind, width, height, 0, 0, width, height, low_us, 0, 0, centi_celsius, 25),
    )


def write_wire(path, frames, *, gray=None, celsius=None):
    """Samples [N, 4, H, W] centred on zero, each after its gray image [N, H, W] where there is."""
    height, width = frames.shape[-2:]
    content = b""
    for number, frame in enumerate(frames):
        degrees = 31.5 if celsius is None else celsius[number]
        if gray is not None:
            content += wire_header(3, width, height) + gray[number].astype("<u2").tobytes()
        content += wire_header(4, width, height, centi_celsius=round(100 * degrees))
        content += (frame + 2048).astype("<u2").tobytes()
    path.write_bytes(content)


def raw12(words):
    """Bytes [..., W * 3 / 2] of words [..., W]."""
    words = np.asarray(words, np.int64) & 0xFFF
    even, odd = words[..., 0::2], words[..., 1::2]
    triples = np.stack((even >> 4, odd >> 4, (even & 15) | ((odd & 15) << 4)), axis=-1)
    return triples.reshape(*words.shape[:-1], -1).astype(np.uint8)


def write_raw12(path, frames, *, row_bytes=None, trailer=b"", twelfth=None):
    """Frames [F, K, P, H, W] of signed words; rows padded to `row_bytes`, `trailer` after a K."""
    content = b""
    for group in frames.reshape(-1, *frames.shape[2:]):
        words = group if twelfth is None else (group & 0x7FF) | (twelfth << 11)
        rows = raw12(words)
        if row_bytes is not None:
            padding = [(0, 0)] * (rows.ndim - 1) + [(0, row_bytes - rows.shape[-1])]
            rows = np.pad(rows, padding, constant_values=0xAA)
        content += rows.tobytes() + trailer
    path.write_bytes(content)


def companding():
    """The value of each of the words 0..1023."""
    values, value = [], 0
    for word in range(1024):
        values.append(value)
        value += 1 << (word // 128 - (1 if word >= 128 else 0))
    return np.array(values)


def write_kinect(path, frames, *, saturated=()):
    """Frames [F, 9, 424, 512] as companded words of 11 bits; returns what words can hold of them.

    `saturated` are (frame, plane, row, column) whose word says that the pixel was full.
    """
    values = companding()
    codes = np.searchsorted((values[1:] + values[:-1]) / 2, np.abs(frames), side="right")
    held = np.where(frames < 0, -values[codes], values[codes])
    words = codes + 1024 * ((frames < 0) & (codes > 0))
    for place in saturated:
        words[place] = 1024
    row, column = np.arange(424), np.arange(512)
    with h5py.File(path, "w") as file:
        for number, nine in enumerate(words):
            ten = np.concatenate((nine, nine[:1]))
            stored = np.zeros_like(ten)
            # Lower half downwards first, then the upper one upwards; columns woven by four.
            stored[:, np.where(row < 212, row + 212, 423 - row)] = ten
            woven = np.zeros_like(stored)
            woven[:, :, column // 4 + column % 4 * 128] = stored
            bits = (woven[..., None] >> np.arange(11)) & 1
            content = np.packbits(bits.astype(np.uint8).reshape(10, 424, -1), -1, "little")
            file[f"Frame_{number}/Ir"] = content.reshape(-1).astype(np.int8, casting="unsafe")
    held[..., [0, -1]] = 0
    return held


def small_camera(folder, name, **changes):
    """A shipped description with other values, such as `layout={"height": 24}`, in `folder`."""
    described = yaml.safe_load((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8"))
    for key, value in changes.items():
        if isinstance(value, dict):
            described[key] = {**described.get(key, {}), **value}
        else:
            described[key] = value
    path = folder / f"{name}_small.yaml"
    path.write_text(yaml.safe_dump(described), encoding="utf-8")
    return path
