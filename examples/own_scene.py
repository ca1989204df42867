"""Write a garage corner as a Mitsuba scene and a workshop as GLB, each with its ways, and say how
to render them:

    python examples/own_scene.py my_scenes
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import trimesh

GARAGE = """<scene version="3.0.0">
  <bsdf type="twosided" id="concrete"><bsdf type="diffuse">
    <spectrum name="reflectance" value="0.35"/></bsdf></bsdf>
  <bsdf type="twosided" id="red wall"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.6, 0.1, 0.1"/></bsdf></bsdf>
  <bsdf type="plastic" id="ball"/>

  <shape type="rectangle" id="floor">
    <transform name="to_world"><scale x="6" y="3"/><translate x="5"/></transform>
    <ref id="concrete"/></shape>
  <shape type="rectangle" id="ceiling">
    <transform name="to_world"><scale x="6" y="3"/><rotate x="1" angle="180"/>
      <translate x="5" z="2.4"/></transform>
    <ref id="concrete"/></shape>
  <shape type="rectangle" id="end">
    <transform name="to_world"><scale x="1.2" y="3"/><rotate y="1" angle="-90"/>
      <translate x="11" z="1.2"/></transform>
    <ref id="concrete"/></shape>
  <shape type="rectangle" id="left">
    <transform name="to_world"><scale x="6" y="1.2"/><rotate x="1" angle="90"/>
      <translate x="5" y="3" z="1.2"/></transform>
    <ref id="red wall"/></shape>
  <shape type="cube" id="pillar">
    <transform name="to_world"><scale x="0.2" y="0.2" z="1.2"/>
      <translate x="6" y="-1.5" z="1.2"/></transform>
    <ref id="concrete"/></shape>
  <shape type="sphere" id="gym ball">
    <point name="center" x="5" y="1.2" z="0.4"/><float name="radius" value="0.4"/>
    <ref id="ball"/></shape>
  <shape type="rectangle" id="luminaire">
    <transform name="to_world"><scale x="0.6" y="0.1"/><rotate x="1" angle="180"/>
      <translate x="6" z="2.35"/></transform>
    <ref id="concrete"/>
    <emitter type="area"><spectrum name="radiance" value="6.0"/></emitter></shape>
  <emitter type="constant"><spectrum name="radiance" value="0.1"/></emitter>
</scene>
"""

GARAGE_MATERIALS = """materials:
  red wall: {albedo: [0.35, 0.55], texture_m: 2.0}   # red to the eye, bright at 940 nm
  ball: {albedo: 0.6, mirror: 0.04}
"""

GARAGE_PATH = """clips:
  - split: train          # poses over time
    poses:
      - {time_s: 0.0, position_m: [0.0, 0.0, 0.9]}
      - {time_s: 0.6, position_m: [0.8, 0.0, 0.9], yaw_deg: 4}
      - {time_s: 1.2, position_m: [1.8, 0.3, 0.9], yaw_deg: 12, pitch_deg: 4}
  - split: test           # way points, and a speed that brakes
    waypoints_m: [[0.0, -0.6, 0.9], [1.5, -0.5, 0.9], [3.0, 0.0, 0.9]]
    speed_m_s: [[0.0, 2.5], [0.8, 1.5], [1.2, 0.0]]
"""

WORKSHOP_MATERIALS = """materials:
  floor: {albedo: [0.25, 0.40], texture_m: 1.5, mirror: 0.05}
  wall: {albedo: 0.6}
  crate: {albedo: [0.45, 0.6], texture_m: 0.6}
  sign: {albedo: 0.5, retro: 100}
"""

WORKSHOP_PATH = """# GLB has y up and metres, by its standard; here are x ahead, y left, z up.
lights:
  sky: {zenith: 0.05, horizon: 0.1}
  lamps:
    - {position_m: [3, 0, 2.8], intensity_w_sr: 3.0, cutoff_deg: 80}
clips:
  - poses:
      - {time_s: 0.0, position_m: [0.0, 0.0, 0.8]}
      - {time_s: 0.8, position_m: [1.0, 0.2, 0.8], yaw_deg: -5}
"""


def workshop() -> trimesh.Scene:
    """A floor, two walls, crates and a sign, y up."""
    scene = trimesh.Scene()

    def add(name: str, material: str, size, centre) -> None:
        box = trimesh.creation.box(extents=size)
        box.apply_translation(centre)
        named = trimesh.visual.material.PBRMaterial(name=material)
        box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=named)
        scene.add_geometry(box, node_name=name, geom_name=name)

    # x ahead, y up, z to the right.
    add("ground", "floor", (12, 0.1, 8), (5, -0.05, 0))
    add("back", "wall", (0.1, 3, 8), (9, 1.5, 0))
    add("side", "wall", (12, 3, 0.1), (5, 1.5, -3))
    add("crate", "crate", (0.8, 0.8, 0.8), (4, 0.4, -1.2))
    add("small crate", "crate", (0.5, 0.5, 0.5), (4.1, 1.05, -1.2))
    add("tall crate", "crate", (0.6, 1.4, 0.6), (5.5, 0.7, 1.4))
    add("sign", "sign", (0.02, 0.4, 0.6), (8.9, 1.6, 0.8))
    return scene


def main(folder: Path) -> None:
    """Write both scenes with what belongs to them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "garage.xml").write_text(GARAGE, encoding="utf-8")
    (folder / "garage_path.yaml").write_text(GARAGE_PATH, encoding="utf-8")
    (folder / "garage_materials.yaml").write_text(GARAGE_MATERIALS, encoding="utf-8")
    workshop().export(folder / "workshop.glb")
    (folder / "workshop_path.yaml").write_text(WORKSHOP_PATH, encoding="utf-8")
    (folder / "workshop_materials.yaml").write_text(WORKSHOP_MATERIALS, encoding="utf-8")
    for name, suffix in (("garage", "xml"), ("workshop", "glb")):
        files = f"{folder / name}"
        print(
            f"shotenv render --scene {files}.{suffix} --path {files}_path.yaml "
            f"--materials {files}_materials.yaml --out {folder / 'banks' / name}"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "my_scenes"))
