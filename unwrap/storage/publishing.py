"""Files of a local folder onto a place, so that what is half there never counts as whole."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from unwrap.storage.listing import LARGEST_JSON_BYTES, Listing, StoredFile, stored_files
from unwrap.storage.place import Place, StorageError

CONTENTS = "contents.json"


def publish_part(
    place: Place,
    label: str,
    part: str,
    folder: Path,
    names: Sequence[str] | None = None,
    *,
    under: str = "",
) -> Listing:
    """Publish files of `folder` as one part: first what is in them, then the part's listing.

    What lies there already is not uploaded again.

    Parameters
    ----------
    label : str
        What the part belongs to.
    part : str
        Name of the part.
    names : sequence of str, optional
        Paths of the files in `folder`, in the order in which they are to be fetched; by default
        all that lie directly in it, but for hidden ones.
    under : str
        Folder of the files in what is published.

    Raises
    ------
    StorageError
        The place cannot be written, or what is to be published is no regular file.
    """
    if names is None:
        names = sorted(p.name for p in folder.iterdir() if not p.name.startswith("."))
    listing = Listing(label=label, files=stored_files(folder, names, under=under))
    for name, file in zip(names, listing.files, strict=True):
        _upload(place, file, folder / name)
    place.write(_part_name(label, part), listing.encoded())
    return listing


def standing_parts(place: Place, label: str) -> dict[str, Listing]:
    """Parts of `label` that are whole: their listing and each of their objects lie there.

    A damaged listing, or an object that is missing or has another length, is none.
    """
    folder = f"parts/{label}"
    names = [
        name
        for name, size in place.sizes(folder).items()
        if name.endswith(".json") and size <= LARGEST_JSON_BYTES
    ]
    lengths = place.sizes("objects") if names else {}
    parts = {}
    for name, content in sorted(place.read_all(names).items()):
        try:
            listing = Listing.decoded(content)
        except ValueError:
            continue
        whole = all(lengths.get(file.object_name) == file.bytes for file in listing.files)
        if whole and listing.label == label:
            parts[name.removeprefix(f"{folder}/").removesuffix(".json")] = listing
    return parts


def find_part(place: Place, label: str, part: str) -> Listing | None:
    """Listing of one part, or None where it is not whole, see `standing_parts`."""
    content = place.read(_part_name(label, part), most_bytes=LARGEST_JSON_BYTES)
    try:
        listing = Listing.decoded(content or b"")
    except ValueError:
        return None
    whole = all(place.size(file.object_name) == file.bytes for file in listing.files)
    return listing if whole and listing.label == label else None


def publish_contents(
    place: Place, label: str, parts: Iterable[Listing], folder: Path, names: Sequence[str]
) -> Listing:
    """Publish the table of contents: `parts`, then the files `names` of `folder`, in that order.

    This makes it complete.

    Raises
    ------
    StorageError
        The place holds something else, or cannot be written.
    """
    _require_label(place, label)
    rest = stored_files(folder, names)
    for name, file in zip(names, rest, strict=True):
        _upload(place, file, folder / name)
    listing = Listing(label=label, files=(*(f for part in parts for f in part.files), *rest))
    place.write(CONTENTS, listing.encoded())
    return listing


def _require_label(place: Place, label: str) -> None:
    """Refuse a place where something else was published.

    Raises
    ------
    StorageError
        Names the place and what it holds.
    """
    standing = _contents(place)
    if standing is not None and standing.label != label:
        raise StorageError(
            f"{place.url} holds {standing.label}, not {label}; choose another place, nothing is "
            "written over"
        )


def place_to_publish(url: str, label: str) -> Place:
    """A place where `label` may be published, before the work begins that makes it.

    Raises
    ------
    StorageError
        It holds something else, or cannot be written.
    """
    place = Place(url)
    _require_label(place, label)
    place.require_writable()
    return place


def read_contents(place: Place) -> Listing:
    """What was published there.

    Raises
    ------
    StorageError
        Nothing, not yet all of it, or the table of contents is damaged.
    """
    listing = _contents(place)
    if listing is None:
        raise StorageError(
            f"{place.url} holds no {CONTENTS}: nothing was published there, or publishing was cut "
            "off; run the command that publishes it again"
        )
    return listing


def _contents(place: Place) -> Listing | None:
    content = place.read(CONTENTS, most_bytes=LARGEST_JSON_BYTES)
    if content is None:
        return None
    try:
        return Listing.decoded(content)
    except ValueError as error:
        raise StorageError(
            f"{place.url}/{CONTENTS} is damaged ({error}); delete it and publish again"
        ) from None


def _part_name(label: str, part: str) -> str:
    return f"parts/{label}/{part}.json"


def _upload(place: Place, file: StoredFile, source: Path) -> None:
    # One of that name with another length is an upload that was cut off.
    if place.size(file.object_name) != file.bytes:
        place.upload(file.object_name, source)
