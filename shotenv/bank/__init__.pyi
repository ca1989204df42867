from .build import build_bank as build_bank, cache_dir as cache_dir
from .fits import check_fits as check_fits
from .frames_reader import Bank as Bank, BankFrame as BankFrame, Clip as Clip
from .listing import (
    describe_bank as describe_bank,
    known_banks as known_banks,
    print_bank as print_bank,
    print_banks as print_banks,
)
from .opening import open_bank as open_bank
from .overview import contact_sheet as contact_sheet
from .predictions import KeptPredictions as KeptPredictions, keep_predictions as keep_predictions
from .store import BankError as BankError, verify as verify
