"""Names of a bank's splits and of the families of scenes, which `shotenv.world` draws."""

from __future__ import annotations

from typing import Literal

Split = Literal["train", "validation", "test", "shift"]
"""`shift` holds clips of families that no other split has."""

Family = Literal[
    "sunny_road",
    "overcast_street",
    "garage",
    "tunnel",
    "night_road",
    "warehouse",
    "construction_site",
    "forest_path",
    "snowy_street",
    "clutter",
]

FAMILIES: tuple[Family, ...] = ("sunny_road", "overcast_street", "garage", "tunnel", "night_road")
"""Families of all splits but `shift`, unless a bank says otherwise."""

SHIFT_FAMILIES: tuple[Family, ...] = (
    "warehouse",
    "construction_site",
    "forest_path",
    "snowy_street",
)
"""Held out: other geometry, materials and light, and kinds of things that FAMILIES never show."""

TRAINING_FAMILIES: tuple[Family, ...] = ("clutter",)
"""For networks to learn from: in the train split alone, and not in drives unless asked for."""
