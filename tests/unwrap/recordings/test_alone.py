"""Real cameras are served without the environment: `unwrap` alone reads, corrects and writes."""

import subprocess
import sys

import numpy as np

ALONE = """
import sys
from pathlib import Path
import unwrap.comparison, unwrap.export
from unwrap.comparison import TableConfig, make_table
from unwrap.export import CheckedExport
from unwrap.recordings import camera_of, correct_recording, load_recording, write_frames
from unwrap.signal import SensorDescription

camera = camera_of(
    SensorDescription(min_snr=3.0),
    bits=12,
    unwrapper="tofsegnet",
    merge="nearest",
    horizontal_fov_deg=60.0,
    noise_lsb=2.0,
)
assert camera.description.noise_lsb == 2.0 and camera.description.min_snr == 3.0
recording = load_recording(Path("frame.npz"), bits=camera.bits)
found = write_frames(correct_recording(recording, camera), camera, Path("out"))
assert found["shots"] == 4 and found["frames"][0]["valid_share"] > 0.9
print([name for name in sys.modules if name.partition(".")[0] in ("shotenv", "agents")])
"""


def test_a_recording_is_corrected_without_the_environment(tmp_path):
    random = np.random.default_rng(0)
    phase_rad = random.uniform(0, 2 * np.pi, (24, 32))
    dcs = np.stack([2048 + 800 * np.cos(phase_rad - k * np.pi / 2) for k in range(4)])
    gray = random.integers(0, 4096, phase_rad.shape).astype(np.uint16)
    np.savez(tmp_path / "frame.npz", dcs=dcs.astype(np.uint16), gray=gray)
    command = [sys.executable, "-c", ALONE]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
    assert (tmp_path / "out/points.ply").is_file()
