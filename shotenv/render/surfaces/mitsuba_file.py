"""What stands in a Mitsuba scene file, as plain values; nothing in it is loaded or built.

Mitsuba's own parser reads it, so that versions, defaults, includes and transforms mean what they
mean to Mitsuba.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from shotenv.render.backend import start_mitsuba
from unwrap.support import read_regular

LARGEST_XML_BYTES = 64 * 2**20
DEEPEST_INCLUDE = 8


class SceneFileError(ValueError):
    """A scene's file that cannot be read or mapped; the message names file, part and cure."""


@dataclass(frozen=True)
class Part:
    """One plugin of a scene file.

    Attributes
    ----------
    kind, plugin : str
        Such as "shape" and "sphere"; kinds in lower case.
    name : str
        Its id, or "" where it has none.
    values : dict
        By name: numbers, texts, points and colours as tuples, transforms as matrices [4, 4].
        Spectra and colours that are the same everywhere are one number; others of them are tuples
        or None, as is anything that is no plain value.
    parts : dict of Part
        Plugins within it or that it refers to, by name; unnamed ones by numbers of Mitsuba's.
    """

    kind: str
    plugin: str
    name: str
    values: dict[str, Any] = field(default_factory=dict)
    parts: dict[str, Part] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """What the part is called in messages."""
        return f"{self.kind} {self.plugin}" + (f" {self.name!r}" if self.name else "")


def parse_mitsuba(path: Path) -> tuple[Part, ...]:
    """Parts at the top of the scene file `path`, in their order.

    Raises
    ------
    SceneFileError
        It is not a Mitsuba scene, or includes or defines what lies outside its folder.
    RendererError
        Mitsuba is missing.
    """
    _check_includes(path, path.parent.resolve(), 0)
    mi = start_mitsuba()
    config = mi.parser.ParserConfig(mi.variant())
    config.max_include_depth = DEEPEST_INCLUDE
    try:
        state = mi.parser.parse_file(config, str(path))
        mi.parser.transform_upgrade(config, state)
        mi.parser.transform_resolve_references(config, state)
    except RuntimeError as error:
        raise SceneFileError(f"{path} is no scene that Mitsuba reads: {error}") from None
    root = _part(state, 0, {})
    if root.kind != "scene":
        raise SceneFileError(f"{path} holds a {root.title}; expected a scene")
    return tuple(root.parts.values())


def _check_includes(path: Path, folder: Path, depth: int) -> None:
    """Refuse XML that reaches out of its folder while it is parsed, or that defines entities."""
    if depth > DEEPEST_INCLUDE:
        raise SceneFileError(f"{path} is included {depth} deep; expected at most {DEEPEST_INCLUDE}")
    try:
        content = read_regular(path, LARGEST_XML_BYTES)
    except ValueError as error:
        raise SceneFileError(f"{path} is no scene that Mitsuba reads: {error}") from None
    # In other encodings than those that hold ASCII the next look would see nothing.
    if b"\0" in content:
        raise SceneFileError(f"{path} is in UTF-16 or UTF-32; expected UTF-8")
    # Entities may stand for each other without end; Mitsuba's scenes have none.
    if b"<!" in content.replace(b"<!--", b"").replace(b"<![CDATA[", b""):
        raise SceneFileError(f"{path} has a document type or entities; expected neither")
    try:
        elements = list(ElementTree.fromstring(content).iter())
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise SceneFileError(f"{path} is no XML: {error}") from None
    for element in elements:
        if element.tag == "path":
            raise SceneFileError(f"{path} adds a search path; expected files beside the scene")
        if element.tag == "include":
            name = element.get("filename", "")
            if "$" in name:
                raise SceneFileError(
                    f"{path} includes {name!r}; expected a name without parameters"
                )
            _check_includes(file_within(folder, name, path), folder, depth + 1)


def file_within(folder: Path, name: str, source: Path) -> Path:
    """The file `name` in `folder` or below, which `source` asks for.

    Raises
    ------
    SceneFileError
        It lies elsewhere, or is no file.
    """
    found = (folder / name).resolve()
    if not found.is_relative_to(folder.resolve()):
        raise SceneFileError(f"{source} names {name!r}, which lies outside {folder}")
    if not found.is_file():
        raise SceneFileError(f"{source} names {name!r}, but {found} is no file")
    return found


def _part(state: Any, index: int, known: dict[int, Part | None]) -> Part:
    """Node `index` of a parsed file, with what it refers to; `known` are those met before."""
    import mitsuba as mi

    node = state.nodes[index]
    properties = node.props
    kind, plugin = node.type.name.lower(), properties.plugin_name()
    part = Part(kind, plugin, properties.id())
    # Each node is read once: those that refer twice to the next would be without number.
    if index in known:
        if (met := known[index]) is None:
            raise SceneFileError(f"{part.title} refers to itself")
        return met
    known[index] = None
    for name in properties.keys():  # noqa: SIM118 - they are no mapping
        try:
            value = properties[name]
        except RuntimeError:  # Kinds of values that Python is not given.
            value = None
        if isinstance(value, mi.Properties.ResolvedReference):
            part.parts[name] = _part(state, value.index(), known)
        else:
            part.values[name] = _plain(properties.type(name).name, value)
            if not _is_finite(part.values[name]):
                raise SceneFileError(f"{name} of {part.title} is {value}; expected finite numbers")
    known[index] = part
    return part


def _plain(kind: str, value: Any) -> Any:
    """A property's value of one of Mitsuba's kinds, without Mitsuba's types."""
    if kind in ("Bool", "Integer", "Float", "String"):
        return value
    if kind == "Transform":
        return np.array(value.matrix, np.float64)
    if kind == "Vector":
        return tuple(float(number) for number in value)
    if kind == "Color":
        red, green, blue = (float(number) for number in value)
        return red if red == green == blue else (red, green, blue)
    if kind == "Spectrum" and len(value.values) == 1:
        return float(value.values[0])
    return None


def _is_finite(value: Any) -> bool:
    """Whether a plain value has no number that is NaN or infinite."""
    return value is None or isinstance(value, str) or bool(np.isfinite(value).all())
