from .bank import (
    Bank as Bank,
    BankFrame as BankFrame,
    Clip as Clip,
    RenderedBank as RenderedBank,
    require_full as require_full,
)
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
from .layout import BankError as BankError, ClipFacts as ClipFacts, StoredNetwork as StoredNetwork
from .opening import find_thinned as find_thinned, open_bank as open_bank
from .predictions import (
    KeptPredictions as KeptPredictions,
    PredictedDistances as PredictedDistances,
    keep_predictions as keep_predictions,
)
from .store import cure_for as cure_for, verify as verify
from .thinned import (
    FARTHEST_M as FARTHEST_M,
    LOG_AMBIENT as LOG_AMBIENT,
    ThinnedBank as ThinnedBank,
    encode_light as encode_light,
    write_thinned as write_thinned,
)
from .word_bank import (
    ClipSettings as ClipSettings,
    TruthLevel as TruthLevel,
    WordBank as WordBank,
)
