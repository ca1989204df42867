from .bank import Bank as Bank, BankFrame as BankFrame, Clip as Clip
from .build import build_bank as build_bank
from .compatibility import check_fits as check_fits
from .contact_sheets import contact_sheet as contact_sheet
from .contents import (
    contents_of as contents_of,
    known_banks as known_banks,
    print_banks as print_banks,
    print_contents as print_contents,
)
from .folders import cache_dir as cache_dir
from .layout import BankError as BankError
from .opening import open_bank as open_bank
from .predictions import KeptPredictions as KeptPredictions, keep_predictions as keep_predictions
from .store import verify as verify
