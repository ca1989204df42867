"""The renderer as software: repeatable, one kernel, clear errors."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from render_worlds import DARK, SMALL, floor, mesh, square, wall, world

from shotenv.render.backend import llvm
from shotenv.render.backend.llvm import RendererError, find_llvm
from shotenv.render.frame import render_frame
from shotenv.render.instants import frame_instants
from shotenv.render.surfaces.geometry import REACH_M, faces_of, posed, tile_grid
from shotenv.render.surfaces.texture import noise_texture
from shotenv.world.geometry.model import Lamp, Light, MovingObject
from shotenv.world.geometry.motion import Arc, Pose, rotation
from unwrap.signal.shots import sample_times_s

CAMERA = SMALL.model_copy(update={"samples_per_pixel": 3, "gray_instants": 2, "bounces": 2})
DAYLIGHT = Light(5.0, (-0.6, 0.0, 0.8), 2.0, 1.0, (Lamp((2.0, 0.0, 3.0), 1.0),))


def corner(**changes):
    return world(mesh(np.concatenate([wall(5.0), floor()])), light=DAYLIGHT, **changes)


def same(first, second) -> bool:
    names = ("correlation", "active", "ambient", "distance_m")
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in names)


# --- frames


@pytest.mark.render
def test_the_same_arguments_give_the_same_bits(sensor):
    frames = [render_frame(corner(), 0.1, CAMERA, sensor, seed=7) for _ in range(2)]
    assert same(*frames)


@pytest.mark.render
def test_another_seed_gives_other_noise(sensor):
    one, other = (render_frame(corner(), 0.1, CAMERA, sensor, seed=seed) for seed in (7, 8))
    assert not np.array_equal(one.ambient, other.ambient)
    assert not np.array_equal(one.correlation, other.correlation)
    assert np.array_equal(one.distance_m, other.distance_m)


@pytest.mark.render
def test_frames_have_the_documented_shapes(sensor):
    frame = render_frame(corner(), 0.0, CAMERA, sensor, seed=0)
    assert frame.correlation.shape == (8, CAMERA.height, CAMERA.width)
    for image in (frame.active, frame.ambient, frame.distance_m):
        assert image.shape == (CAMERA.height, CAMERA.width)
        assert image.dtype == np.float32
    assert frame.correlation.dtype == np.float32
    assert np.isfinite(frame.correlation).all() and np.isfinite(frame.ambient).all()
    assert (np.abs(frame.correlation) <= 1.001 * frame.active.max()).all()


@pytest.mark.render
def test_all_worlds_share_the_kernels_of_light_and_filter(sensor):
    llvm.start_mitsuba()
    import drjit as dr

    thing = MovingObject(mesh(square((3, 0, 1), (0, 0.3, 0), (0, 0, 0.3))), Arc(Pose((0, 0, 0))))
    bare = world(mesh(wall(4.0)), light=DARK)
    worlds = [bare, corner(), corner(moving=(thing,)), corner(moving=(thing,) * 3, speed_m_s=3.0)]
    kernels = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for index, scene in enumerate(worlds):
            dr.kernel_history_clear()
            render_frame(scene, 0.1 * index, CAMERA, sensor, seed=index)
            history = dr.kernel_history((dr.KernelType.JIT,))
            kernels.append(
                {kernel["hash"] for kernel in history if kernel["operation_count"] > 500}
            )
    assert len(kernels[0]) == 2
    assert all(others == kernels[0] for others in kernels)


@pytest.mark.render
def test_more_bounces_bring_more_light_into_a_corner(sensor):
    one, two = (
        render_frame(corner(), 0.0, CAMERA.model_copy(update={"bounces": bounces}), sensor, seed=0)
        for bounces in (1, 2)
    )
    assert two.active.sum() > 1.01 * one.active.sum()
    assert two.ambient.sum() > 1.05 * one.ambient.sum()


def test_samples_are_taken_at_their_own_instants(sensor):
    instants = frame_instants(2.0, CAMERA, sensor)
    starts = sample_times_s(8, sensor.sample_period_s)
    assert instants.times_s[:8] == pytest.approx([2.0 + start for start in starts])
    exposure_s = sensor.gray_max_exposure_s
    assert instants.times_s[8:] == pytest.approx([2.0 - exposure_s / 4, 2.0 - exposure_s * 3 / 4])
    shorter = frame_instants(2.0, CAMERA, sensor, gray_exposure_s=exposure_s / 5)
    assert shorter.times_s[8:] == pytest.approx([2.0 - exposure_s / 20, 2.0 - exposure_s * 3 / 20])
    assert instants.laser == (True,) * 8 + (False,) * 2
    assert len(set(instants.draw[:8])) == 1


# --- geometry and texture


def test_tiles_are_out_of_each_others_reach():
    things = (MovingObject(mesh(wall(0.0, 5.0)), Arc(Pose((30.0, 10.0, 0.0)), 5.0)),)
    times = tuple(np.linspace(0, 1, 12))
    scene = corner(moving=things)
    moving = posed(scene, faces_of(scene), times, bounces=2)
    copies = moving.corners.reshape(len(times), -1, 3)
    for index, tile in enumerate(moving.tile_m):
        others = np.delete(copies, index, axis=0)[..., :2].reshape(-1, 2)
        assert np.linalg.norm(others - tile[:2], axis=1).min() >= 3 * REACH_M


def test_things_stand_where_their_motion_brings_them():
    motion = Arc(Pose((3.0, -1.0, 0.2), 0.4, 0.1), speed_m_s=8.0, yaw_rate_rad_s=0.7)
    thing = MovingObject(mesh(square((0.3, 0.1, 1), (0.2, 0.3, 0), (0, 0.1, 0.5))), motion)
    scene, times = (
        corner(moving=(MovingObject(mesh(wall(1.0)), Arc(Pose((0, 0, 0)))), thing)),
        (0.0, 0.3),
    )
    found = posed(scene, faces_of(scene), times, bounces=2)
    for t, pose in enumerate(map(motion.at, times)):
        expected = thing.mesh.corners.astype(float) @ rotation(pose).T + pose.position_m
        on_tile = found.corners[t, 2:] - found.tile_m[t]
        np.testing.assert_allclose(on_tile, expected, atol=1e-4)
        across = np.cross(expected[:, 1] - expected[:, 0], expected[:, 2] - expected[:, 0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        np.testing.assert_allclose(found.normals[t, 2:, :3], across, atol=1e-6)


def test_panes_stand_with_the_things_that_they_are_part_of():
    pane = MovingObject(mesh(wall(2.0, 1.0), clear=0.5), Arc(Pose((0, 0, 0)), 5.0))
    scene = replace(corner(moving=(pane,)), static=mesh(wall(7.0), clear=0.3))
    found = posed(scene, faces_of(scene), (0.0, 0.2), bounces=1)
    ahead = (found.panes.reshape(2, 4, 3, 3) - found.tile_m[:, None, None])[..., 0]
    np.testing.assert_allclose(ahead[:, :2], 7.0, atol=1e-4)
    np.testing.assert_allclose(ahead[:, 2:, 0], [[2.0, 2.0], [3.0, 3.0]], atol=1e-4)


def test_tiles_stand_about_the_origin():
    grid = tile_grid(12, 400.0)
    assert len(np.unique(grid, axis=0)) == 12
    assert np.abs(grid).max() <= 600.0


def test_the_texture_is_full_and_has_no_seam():
    noise = noise_texture()
    assert noise.min() == 0.0 and noise.max() == 1.0
    inside = np.abs(np.diff(noise, axis=0)).mean()
    assert np.abs(noise[0] - noise[-1]).mean() < 1.5 * inside
    assert np.abs(noise[:, 0] - noise[:, -1]).mean() < 1.5 * inside


def test_a_world_without_anything_that_moves_has_a_face_to_pad_with():
    assert len(faces_of(corner()).thing) == 1
    moving = replace(corner(), moving=(MovingObject(mesh(wall(3.0)), Arc(Pose((0, 0, 0)))),))
    assert len(faces_of(moving).thing) == 2


# --- LLVM


def test_importing_the_renderer_loads_no_mitsuba():
    code = "import sys, shotenv.render.backend; sys.exit('mitsuba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


@pytest.fixture
def no_library_named(monkeypatch):
    monkeypatch.delenv(llvm.LIBRARY_VARIABLE, raising=False)
    return monkeypatch


def test_a_missing_llvm_is_named_with_its_cure(no_library_named):
    no_library_named.setattr(llvm, "_candidates", lambda: iter(()))
    assert find_llvm() is None
    with pytest.raises(RendererError, match=r"no LLVM library.*apt-get install libllvm19"):
        llvm.require_llvm()


def test_the_newest_llvm_is_taken(no_library_named):
    versions = {"/a/libLLVM-15.so": 15, "/a/libLLVM.so.19.1": 19, "/a/libLLVM-18.so": 18}
    no_library_named.setattr(llvm, "_candidates", lambda: iter(versions))
    no_library_named.setattr(llvm, "llvm_version", versions.get)
    assert llvm.require_llvm() == ("/a/libLLVM.so.19.1", 19)
    assert os.environ[llvm.LIBRARY_VARIABLE] == "/a/libLLVM.so.19.1"


def test_an_old_llvm_is_refused(no_library_named):
    no_library_named.setenv(llvm.LIBRARY_VARIABLE, "/a/libLLVM-15.so")
    no_library_named.setattr(llvm, "llvm_version", lambda path: 15)
    with pytest.raises(
        RendererError, match=r"/a/libLLVM-15\.so is LLVM 15.*16 or newer.*libllvm19"
    ):
        llvm.require_llvm()


def test_a_file_that_is_no_llvm_is_refused(no_library_named, tmp_path):
    path = tmp_path / "libLLVM-19.so"
    path.write_text("not a library")
    no_library_named.setenv(llvm.LIBRARY_VARIABLE, str(path))
    with pytest.raises(RendererError, match=r"libLLVM-19\.so cannot be loaded.*libllvm19"):
        llvm.require_llvm()


@pytest.mark.render
def test_rendering_with_an_old_llvm_ends_in_an_error_and_not_in_an_abort():
    old = [path for path in llvm._candidates() if "libLLVM-15" in path or "libLLVM-14" in path]
    if not old:
        pytest.skip("no old LLVM on this machine")
    code = (
        "from shotenv.render.backend.llvm import RendererError, start_mitsuba\n"
        "try: start_mitsuba()\n"
        "except RendererError as error: print(error)"
    )
    environment = {**os.environ, llvm.LIBRARY_VARIABLE: old[0]}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert f"{old[0]} is LLVM 1" in done.stdout


def test_an_unknown_variant_is_refused():
    with pytest.raises(ValueError, match="variant is 'scalar_rgb'; expected one of llvm_ad_mono"):
        llvm.start_mitsuba("scalar_rgb")


def test_the_variant_is_the_one_that_the_environment_names(monkeypatch):
    monkeypatch.delenv(llvm.VARIANT_VARIABLE, raising=False)
    assert llvm.chosen_variant() == "llvm_ad_mono"
    monkeypatch.setenv(llvm.VARIANT_VARIABLE, "cuda_ad_mono")
    assert llvm.chosen_variant() == "cuda_ad_mono"
    monkeypatch.setenv(llvm.VARIANT_VARIABLE, "cuda")
    with pytest.raises(RendererError, match="SHOTENV_MITSUBA_VARIANT is 'cuda'; expected one of"):
        llvm.require_device()


def test_rendering_on_a_gpu_needs_no_llvm(no_library_named):
    no_library_named.setenv(llvm.VARIANT_VARIABLE, "cuda_ad_mono")
    no_library_named.setattr(llvm, "_candidates", lambda: iter(()))
    llvm.require_device()
