"""Files made hostile: what damage, chance and malice do to the bytes of a file that is read."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

HUGE = (2**31 - 1, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1)
WRONG: tuple[Any, ...] = (
    *(None, True, -1, 0, 0.5, 1e300, -1e300, float("nan"), float("inf"), 10**30, 2**63),
    *("", "x", "../../../etc/passwd", "/dev/zero", "x" * 10_000, "\x00\x1b[31m"),
    *([], {}, [[]], {"x": 1}, [None] * 5, [1e300] * 3, ["x"] * 3),
)


class Canary:
    """Unpickled, it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {self.path}",)


def mutate(path: Path, chance: random.Random, canary: Path) -> str:
    """Change the file `path`, which is as it should be, in a way that is drawn; tells which."""
    ways: list[Callable[[Path, random.Random, Path], object]] = [*GENERAL]
    if path.suffix in (".json", ".yaml"):
        ways += [wrong_value] * 12 + [yaml_bomb, yaml_tag, deep]
    if zipfile.is_zipfile(path):
        ways += [zip_member] * 6
    if path.suffix in (".npy", ".npz"):
        ways += [pickled_array, huge_header]
    if path.suffix in (".safetensors", ".glb"):
        ways += [wrong_header] * 6
    way = chance.choice(ways)
    way(path, chance, canary)
    return way.__name__


def truncated(path: Path, chance: random.Random, canary: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: chance.randrange(len(content))])


def flipped(path: Path, chance: random.Random, canary: Path) -> None:
    content = bytearray(path.read_bytes())
    # Heads tell sizes and kinds: half of the damage goes there.
    end = len(content) if chance.random() < 0.5 else min(len(content), 256)
    for _ in range(chance.choice((1, 1, 2, 8, 64))):
        content[chance.randrange(end)] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def replaced(path: Path, chance: random.Random, canary: Path) -> None:
    content = bytearray(path.read_bytes())
    begin = chance.randrange(len(content))
    end = min(len(content), begin + chance.choice((1, 4, 16, 256)))
    kinds = (b"\x00" * (end - begin), b"\xff" * (end - begin), chance.randbytes(end - begin), b"")
    content[begin:end] = chance.choice(kinds)
    path.write_bytes(content)


def huge_number(path: Path, chance: random.Random, canary: Path) -> None:
    content = bytearray(path.read_bytes())
    width = chance.choice((4, 8))
    begin = chance.randrange(min(len(content), 512))
    number = chance.choice(HUGE) % (1 << 8 * width)
    content[begin : begin + width] = number.to_bytes(width, chance.choice(("little", "big")))
    path.write_bytes(content)


def repeated(path: Path, chance: random.Random, canary: Path) -> None:
    content = path.read_bytes()
    begin = chance.randrange(len(content))
    part = content[begin : begin + chance.choice((1, 16, 1024))]
    path.write_bytes(content[:begin] + part * chance.choice((2, 100, 10_000)) + content[begin:])


def another_thing(path: Path, chance: random.Random, canary: Path) -> None:
    """A pickle, a zip bomb, noise, nothing, a sparse giant, a pipe, a folder, a device."""
    path.unlink()
    match chance.randrange(8):
        case 0:
            path.write_bytes(pickle.dumps(Canary(canary)))
        case 1:
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr("arrays.npy", bytes(1 << 26))
                archive.writestr("../../traversal", b"x")
        case 2:
            path.write_bytes(chance.randbytes(chance.choice((1, 100, 10_000))))
        case 3:
            path.write_bytes(b"")
        case 4:
            with path.open("wb") as file:
                file.truncate(3 << 30)
        case 5:
            os.mkfifo(path)
        case 6:
            path.mkdir()
        case 7:
            path.symlink_to("/dev/zero")


def wrong_value(path: Path, chance: random.Random, canary: Path) -> None:
    """A value of another kind, a key less or more; a digest that is in the file is made anew."""
    text = path.read_text(encoding="utf-8")
    is_json = path.suffix == ".json"
    whole = json.loads(text) if is_json else yaml.safe_load(text)
    holder, key = chance.choice(list(_places(whole)))
    match chance.randrange(6):
        case 0 if isinstance(holder, dict):
            del holder[key]
        case 1 if isinstance(holder, dict):
            holder["unexpected"] = chance.choice(WRONG)
        case 2 if isinstance(holder, list):
            holder.append(holder[key])
        case _:
            holder[key] = chance.choice(WRONG)
    if isinstance(whole, dict) and "digest" in whole and path.name != "agent.json":
        whole.pop("digest")
        signed = json.dumps(whole, sort_keys=True).encode()
        whole["digest"] = hashlib.sha256(signed).hexdigest()
    path.write_text(json.dumps(whole) if is_json else yaml.safe_dump(whole), encoding="utf-8")


def _places(value: Any) -> Any:
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, one in list(items):
        yield value, key
        if isinstance(one, dict | list):
            yield from _places(one)


def yaml_bomb(path: Path, chance: random.Random, canary: Path) -> None:
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    for before, name in zip("abcdefgh", "bcdefghi", strict=True):
        lines.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]")
    path.write_text("\n".join(lines), encoding="utf-8")


def yaml_tag(path: Path, chance: random.Random, canary: Path) -> None:
    tags = (
        f'!!python/object/apply:os.system ["touch {canary}"]',
        f'!!python/object/new:os.system ["touch {canary}"]',
        f"!!python/name:os.system touch {canary}",
    )
    path.write_text(f"name: {chance.choice(tags)}\n", encoding="utf-8")


def deep(path: Path, chance: random.Random, canary: Path) -> None:
    depth = chance.choice((100, 10_000, 500_000))
    path.write_text('{"a": ' * depth + "1" + "}" * depth, encoding="utf-8")


def zip_member(path: Path, chance: random.Random, canary: Path) -> None:
    """An archive with one member damaged, swollen, pickled, or of a name that leads elsewhere."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(list(members))
    match chance.randrange(6):
        case 0:
            members[name] = b"\x93NUMPY\x01\x00v\x00" + bytes(1 << 26)
        case 1:
            members["../../../../tmp/traversal.npy"] = members.pop(name)
        case 2:
            members[name] = pickle.dumps(Canary(canary))
        case 3:
            members[name] = _object_array(canary)
        case 4:
            del members[name]
        case 5:
            content = bytearray(members[name])
            content[chance.randrange(min(128, len(content)))] ^= 1 << chance.randrange(8)
            members[name] = bytes(content)
    method = chance.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(path, "w", method, compresslevel=1) as archive:
        for one, content in members.items():
            archive.writestr(one, content)


def _object_array(canary: Path) -> bytes:
    content, array = io.BytesIO(), np.empty(1, object)
    array[0] = Canary(canary)
    np.save(content, array, allow_pickle=True)
    return content.getvalue()


def pickled_array(path: Path, chance: random.Random, canary: Path) -> None:
    if path.suffix == ".npy":
        path.write_bytes(_object_array(canary))
    else:
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("more.npy", _object_array(canary))


def huge_header(path: Path, chance: random.Random, canary: Path) -> None:
    shapes = ("(10000000000000,)", "(99999999999999999999999,)", "(-1,)", "(0,)", "(1,)*10", "((")
    kind = chance.choice(("<f4", "<f8", "|O", "<U9999999", "|V99999999", "nonsense"))
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {chance.choice(shapes)}, }}"
    header = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()
    if path.suffix == ".npy":
        path.write_bytes(header + b"\x00" * 64)
    else:
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        members[chance.choice(list(members))] = header + b"\x00" * 64
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in members.items():
                archive.writestr(name, content)


def wrong_header(path: Path, chance: random.Random, canary: Path) -> None:
    """A JSON header, as those of safetensors and GLB, with a wrong value; lengths fit again."""
    content = path.read_bytes()
    begin = 20 if path.suffix == ".glb" else 8
    length = int.from_bytes(content[12:16] if begin == 20 else content[:8], "little")
    header = json.loads(content[begin : begin + length])
    holder, key = chance.choice(list(_places(header)))
    holder[key] = chance.choice(WRONG)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    rest = content[begin + length :]
    if begin == 8:
        path.write_bytes(len(text).to_bytes(8, "little") + text + rest)
    else:
        whole = (20 + len(text) + len(rest)).to_bytes(4, "little")
        size = len(text).to_bytes(4, "little")
        path.write_bytes(content[:8] + whole + size + content[16:20] + text + rest)


GENERAL = [
    *[truncated] * 3,
    *[flipped] * 5,
    *[replaced] * 3,
    *[huge_number] * 3,
    *[repeated] * 2,
    *[another_thing] * 3,
]
