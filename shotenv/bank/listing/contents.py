"""What is in a bank, and which banks there are: as numbers, and printed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shotenv.bank import (
    MANIFEST,
    SHIPPED,
    THINNED_CONTENTS,
    Bank,
    RecordedContents,
    RenderedBank,
    TableOfContents,
    ThinnedContents,
    bank_bytes,
    bank_folder,
    clips_standing,
    frame_bytes,
    published_table,
    read_thinned_contents,
    rendering_minutes,
)
from shotenv.config import BankConfig, configs_dir, read_config
from unwrap.signal import Shots


def known_banks() -> list[dict[str, Any]]:
    """Each bank that comes along: its size, and how much of it stands.

    First those that are ready, in the package; then those in `configs/bank/`, which stand in the
    cache folder once they are rendered.
    """
    ready = sorted(path.parent for path in SHIPPED.glob(f"*/{THINNED_CONTENTS}"))
    paths = sorted((configs_dir() / "bank").glob("*.yaml"))
    planned = [_planned(read_config(BankConfig, path)) for path in paths]
    return [*(_shipped(folder) for folder in ready), *planned]


def _shipped(folder: Path) -> dict[str, Any]:
    """A bank that lies in the package; only its table of contents is read."""
    about = read_thinned_contents(folder)
    return {
        "name": about.name,
        "frames": sum(clip.frames for clip in about.clips),
        "width": about.width,
        "height": about.height,
        "bytes": _bytes_in(folder),
        "clips": len(about.clips),
        "clips_standing": len(about.clips),
        "rendered": True,
        "minutes_left": 0.0,
        "folder": str(folder),
    }


def _bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def _planned(config: BankConfig) -> dict[str, Any]:
    """Size of the bank of `config`, standing or not, and how far its rendering has come."""
    standing, clips = clips_standing(config)
    frames = clips * config.world.frames_per_clip
    missing = (clips - standing) * config.world.frames_per_clip
    folder = bank_folder(config)
    return {
        "name": config.name,
        "frames": frames,
        "width": config.camera.width,
        "height": config.camera.height,
        "bytes": bank_bytes(config, frames),
        "clips": clips,
        "clips_standing": standing,
        # Clips that stand without a manifest are a rendering that goes on, or was cut off.
        "rendered": standing == clips and (folder / MANIFEST).is_file(),
        "minutes_left": rendering_minutes(config, missing) if missing else 0.0,
        "folder": str(folder),
    }


def print_banks(banks: list[dict[str, Any]]) -> None:
    """A line for each of the `known_banks`."""
    print(f"{'bank':12}{'frames':>7}  {'pixels':>10}{'size':>9}   state")
    for bank in banks:
        print(
            f"{bank['name']:12}{bank['frames']:>7}  {_pixels(bank):>10}"
            f"{_gigabytes(bank['bytes']):>9}   {_state(bank)}"
        )


def _state(bank: dict[str, Any]) -> str:
    if bank["rendered"]:
        return bank["folder"]
    begun = f"{bank['clips_standing']} of {bank['clips']} clips stand"
    state = begun if bank["clips_standing"] else "not rendered"
    return f"{state}, about {bank['minutes_left']:.0f} minutes to render"


def contents_of(bank: Bank) -> dict[str, Any]:
    """Size, frames of each family in each split, and the configuration of `bank`."""
    return _contents(bank.manifest, str(bank.folder), _bytes_of(bank))


def contents_at(url: str) -> dict[str, Any]:
    """The same of a bank at a URL, of which the table of contents alone is fetched.

    Raises
    ------
    BankError, unwrap.storage.StorageError
        What is there is no bank, or cannot be read.
    """
    about, size = published_table(url)
    return _contents(about, url, size)


def _contents(about: TableOfContents, where: str, size: int) -> dict[str, Any]:
    splits: dict[str, dict[str, int]] = {}
    for clip in about.clips:
        families = splits.setdefault(clip.split, {})
        families[clip.family] = families.get(clip.family, 0) + clip.frames
    return {
        "name": about.name,
        "folder": where,
        "fingerprint": about.fingerprint,
        "frames": sum(clip.frames for clip in about.clips),
        "clips": len(about.clips),
        "width": about.width,
        "height": about.height,
        "bytes": size,
        "thinned": _thinning_of(about) if isinstance(about, ThinnedContents) else None,
        "recorded": _recording_of(about) if isinstance(about, RecordedContents) else None,
        "splits": splits,
        "config": None if about.config is None else about.config.model_dump(mode="json"),
    }


def _bytes_of(bank: Bank) -> int:
    # What is packed is as large as it came out.
    if not isinstance(bank, RenderedBank) or bank.manifest.storage == "float16":
        return _bytes_in(bank.folder)
    # Without headers and records, which are less than a thousandth of it.
    return len(bank) * frame_bytes(bank.height, bank.width)


def _thinning_of(about: ThinnedContents) -> dict[str, Any]:
    """What a thinned bank was made from, and the networks whose predictions it holds."""
    return {
        "every": about.every,
        "seed": about.seed,
        "source": {"name": about.config.name, "fingerprint": about.source},
        "networks": [network.model_dump() for network in about.networks],
    }


def _recording_of(about: RecordedContents) -> dict[str, Any]:
    """What recordings are of, what they answer and what they are scored against."""
    return {
        "camera": about.camera,
        "sensor": about.sensor.name,
        "frame_rate_hz": about.frame_rate_hz,
        "answers": [int(shots) for shots in Shots if shots <= about.samples],
        "truth": about.truth,
        "made": about.made,
    }


TRUTHS = {
    "external": "external, a reference",
    "own": "their own eight samples, where both frequencies agree",
    "none": "none: no error is told",
}


def print_contents(about: dict[str, Any]) -> None:
    """The `contents_of` a bank, as words and a table."""
    print(
        f"{about['name']}: {about['frames']} frames of {_pixels(about)} pixels in "
        f"{about['clips']} clips, {_gigabytes(about['bytes'])}"
    )
    print(f"  folder       {about['folder']}\n  fingerprint  {about['fingerprint']}")
    print(f"  rendered     {_settings(about['config'])}")
    if about["thinned"] is not None:
        print(f"  thinned      {_told(about['thinned'])}")
    if (recorded := about["recorded"]) is not None:
        answers = ", ".join(map(str, recorded["answers"]))
        made = ", made of phasors" if recorded["made"] else ""
        print(
            f"  recorded     by {recorded['camera']} at {recorded['frame_rate_hz']:g} Hz, played "
            f"as {recorded['sensor']}; answers {answers} DCS{made}"
        )
        print(f"  truth        {TRUTHS[recorded['truth']]}")
    print()
    _print_counts(about["splits"])


def _told(thinned: dict[str, Any]) -> str:
    every, source = thinned["every"], thinned["source"]
    networks = [f"{one['name']} {one['fingerprint'][:16]}" for one in thinned["networks"]]
    return (
        f"a pixel of each {every} x {every} of {source['name']} ({source['fingerprint']}); "
        f"predictions of {', '.join(networks)}"
    )


def _settings(config: dict[str, Any] | None) -> str:
    if config is None:
        return "no, imported"
    camera, world, sensor = config["camera"], config["world"], config["sensor"]
    own = config["own_scene"]
    clips = f"ways in {own['file']}" if own else f"{world['frames_per_clip']} frames per clip"
    return (
        f"{camera['samples_per_pixel']} rays per pixel and instant, {camera['bounces']} bounces, "
        f"{camera['horizontal_fov_deg']:g} degrees; {clips} at "
        f"{world['frame_rate_hz']:g} Hz; {sensor['name']}, {sensor['f1_hz'] / 1e6:g} and "
        f"{sensor['f2_hz'] / 1e6:g} MHz; seeds from {config['seed']}"
    )


def _print_counts(splits: dict[str, dict[str, int]]) -> None:
    """Frames: a row for each family, a column for each split."""
    families = list(dict.fromkeys(family for counts in splits.values() for family in counts))
    print(f"  {'frames':20}" + "".join(f"{split:>12}" for split in splits))
    for family in families:
        counts = [split.get(family, 0) for split in splits.values()]
        print(f"  {family:20}" + "".join(f"{count or '-':>12}" for count in counts))
    sums = [sum(counts.values()) for counts in splits.values()]
    print(f"  {'all':20}" + "".join(f"{total:>12}" for total in sums))


def _pixels(bank: dict[str, Any]) -> str:
    return f"{bank['width']} x {bank['height']}"


def _gigabytes(size: int) -> str:
    return f"{size / 1e9:.2f} GB" if size >= 1e8 else f"{size / 1e6:.1f} MB"
