"""Open a bank by name or path, rendering it first where it does not stand yet."""

from __future__ import annotations

from pathlib import Path

from shotenv.bank.bank import Bank
from shotenv.bank.build import build_bank, clips_standing
from shotenv.bank.folders import bank_folder
from shotenv.bank.layout import MANIFEST, BankError
from shotenv.config import BankConfig, ConfigError, find_config, read_config


def open_bank(bank: str | Path, *, render: bool = True) -> Bank:
    """Open a bank by name or path.

    Parameters
    ----------
    bank
        A folder that holds a bank, or a configuration: a name in `configs/bank/` or the path of
        a YAML file.
    render
        Render a configured bank first where it does not stand yet; otherwise it is an error.

    Raises
    ------
    BankError
        Neither a bank nor a configuration, or a damaged bank; the message names file and cure.
    """
    # A folder first: who names a path means what lies there, not a configuration of that name.
    if Path(bank).is_dir() and (Path(bank) / MANIFEST).is_file():
        return Bank(Path(bank))
    try:
        path = find_config("bank", str(bank))
    except ConfigError as error:
        raise BankError(f"{error}, or of the folder of a bank") from None
    config = read_config(BankConfig, path)
    if render:
        return Bank(build_bank(config))
    standing, clips = clips_standing(config)
    if not (bank_folder(config) / MANIFEST).is_file():
        raise BankError(
            f"bank {config.name} is not rendered yet ({standing} of {clips} clips stand); "
            f"`shotenv render --config {path}` does it"
        )
    return Bank(bank_folder(config))
