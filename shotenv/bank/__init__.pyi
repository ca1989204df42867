from .bank import (
    Bank as Bank,
    BankFrame as BankFrame,
    Clip as Clip,
    RenderedBank as RenderedBank,
    require_full as require_full,
)
from .build import (
    bank_bytes as bank_bytes,
    build_bank as build_bank,
    clips_standing as clips_standing,
    rendering_minutes as rendering_minutes,
)
from .compatibility import check_fits as check_fits
from .folders import (
    SHIPPED as SHIPPED,
    bank_folder as bank_folder,
    cache_dir as cache_dir,
)
from .layout import (
    MANIFEST as MANIFEST,
    THINNED_CONTENTS as THINNED_CONTENTS,
    BankError as BankError,
    ClipFacts as ClipFacts,
    RecordedClip as RecordedClip,
    RecordedContents as RecordedContents,
    StoredNetwork as StoredNetwork,
    TruthLevel as TruthLevel,
    frame_bytes as frame_bytes,
)
from .opening import find_thinned as find_thinned, open_bank as open_bank
from .predictions import (
    KeptPredictions as KeptPredictions,
    PredictedDistances as PredictedDistances,
    keep_predictions as keep_predictions,
)
from .recorded_bank import RecordedBank as RecordedBank
from .store import (
    cure_for as cure_for,
    read_thinned_contents as read_thinned_contents,
    sha256_of as sha256_of,
    verify as verify,
    write_recorded_contents as write_recorded_contents,
)
from .thinned import (
    FARTHEST_M as FARTHEST_M,
    LOG_AMBIENT as LOG_AMBIENT,
    ThinnedBank as ThinnedBank,
    encode_light as encode_light,
    write_thinned as write_thinned,
)
from .word_bank import (
    ClipSettings as ClipSettings,
    WordBank as WordBank,
)
