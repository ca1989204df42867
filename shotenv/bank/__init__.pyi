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
from .compatibility import check_fits as check_fits, gray_differences as gray_differences
from .files import (
    MANIFEST as MANIFEST,
    SHIPPED as SHIPPED,
    THINNED_CONTENTS as THINNED_CONTENTS,
    BankError as BankError,
    ClipFacts as ClipFacts,
    RecordedClip as RecordedClip,
    RecordedContents as RecordedContents,
    StoredNetwork as StoredNetwork,
    TableOfContents as TableOfContents,
    ThinnedContents as ThinnedContents,
    TruthLevel as TruthLevel,
    bank_folder as bank_folder,
    cache_dir as cache_dir,
    cure_for as cure_for,
    frame_bytes as frame_bytes,
    read_thinned_contents as read_thinned_contents,
    sha256_of as sha256_of,
    verify as verify,
    write_recorded_contents as write_recorded_contents,
)
from .opening import find_thinned as find_thinned, open_bank as open_bank
from .predictions import (
    KeptPredictions as KeptPredictions,
    PredictedDistances as PredictedDistances,
    keep_predictions as keep_predictions,
)
from .published import (
    build_published as build_published,
    fetch_bank as fetch_bank,
    finish_published as finish_published,
    publish_bank as publish_bank,
    publish_clip as publish_clip,
    published_table as published_table,
    standing_clips as standing_clips,
    verify_published as verify_published,
)
from .recorded_bank import RecordedBank as RecordedBank
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
