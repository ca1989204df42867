"""Open a bank by name or path, rendering it first where it does not stand yet."""

from __future__ import annotations

from pathlib import Path

from shotenv.bank.bank import Bank, RenderedBank
from shotenv.bank.build import build_bank, clips_standing
from shotenv.bank.files import (
    MANIFEST,
    RECORDED_CONTENTS,
    SHIPPED,
    THINNED_CONTENTS,
    BankError,
    bank_folder,
)
from shotenv.bank.published import fetch_bank
from shotenv.bank.recorded_bank import RecordedBank
from shotenv.bank.thinned import ThinnedBank
from shotenv.config import BankConfig, ConfigError, find_config, read_config
from unwrap.storage import is_url
from unwrap.support import require_path


def find_thinned(bank: str | Path) -> ThinnedBank | None:
    """The thinned bank of that path, URL or name, or None where there is no such one.

    Raises
    ------
    BankError
        It is damaged.
    """
    require_path(bank=bank)
    if is_url(bank):
        bank = fetch_bank(str(bank))
    # A name is one part: SHIPPED / "/somewhere" would be somewhere.
    folders = [Path(bank), *([SHIPPED / bank] if Path(bank).name == str(bank) else [])]
    for folder in folders:
        # Another bank in a folder of the name of a shipped one is what is meant.
        if any((folder / name).is_file() for name in (MANIFEST, RECORDED_CONTENTS)):
            return None
        if (folder / THINNED_CONTENTS).is_file():
            return ThinnedBank(folder)
    return None


def open_bank(bank: str | Path, *, render: bool = True) -> Bank:
    """Open a bank by name or path.

    Parameters
    ----------
    bank
        A folder that holds a bank; the URL of a place where one was published, which is fetched
        into the cache folder on first use; the name of one that comes with the package
        (`SHIPPED`); or a configuration: a name in `configs/bank/` or the path of a YAML file.
    render
        Render a configured bank first where it does not stand yet; otherwise it is an error.

    Raises
    ------
    BankError
        Neither a bank nor a configuration, or a damaged bank; the message names file and cure.
    unwrap.storage.StorageError
        The place cannot be read, or what lies there is damaged.
    """
    require_path(bank=bank)
    if is_url(bank):
        bank = fetch_bank(str(bank))
    # A folder first: who names a path means what lies there, not a configuration of that name.
    if (Path(bank) / MANIFEST).is_file():
        return RenderedBank(Path(bank))
    if (Path(bank) / RECORDED_CONTENTS).is_file():
        return RecordedBank(Path(bank))
    if (thinned := find_thinned(bank)) is not None:
        return thinned
    try:
        path = find_config("bank", str(bank))
    except ConfigError as error:
        raise BankError(f"{error}, or of the folder of a bank") from None
    config = read_config(BankConfig, path)
    if render:
        return RenderedBank(build_bank(config))
    standing, clips = clips_standing(config)
    if not (bank_folder(config) / MANIFEST).is_file():
        raise BankError(
            f"bank {config.name} is not rendered yet ({standing} of {clips} clips stand); "
            f"`shotenv render --config {path}` does it"
        )
    return RenderedBank(bank_folder(config))
