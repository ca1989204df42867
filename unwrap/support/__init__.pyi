from .array_files import MAX_BYTES as MAX_BYTES, read_arrays as read_arrays
from .checks import (
    require_choice as require_choice,
    require_floats as require_floats,
    require_not_negative as require_not_negative,
    require_path as require_path,
    require_positive as require_positive,
)
from .compiled import (
    array as array,
    array_of as array_of,
    can_loop as can_loop,
    in_parts as in_parts,
    inlined as inlined,
    long_rows as long_rows,
    loop as loop,
    source_stamp as source_stamp,
)
from .error_text import in_one_line as in_one_line, in_short as in_short
from .files import (
    building_folder as building_folder,
    replacing as replacing,
    unfinished as unfinished,
    write_bytes as write_bytes,
    write_json as write_json,
    write_text as write_text,
)
from .npy_header import NpyHeader as NpyHeader, read_npy_header as read_npy_header
from .process_state import (
    keep_freed_memory as keep_freed_memory,
    torch_threads as torch_threads,
)
from .progress_bar import progress as progress, say as say
from .section import (
    Fraction as Fraction,
    NonNegative as NonNegative,
    Positive as Positive,
    Range as Range,
    Section as Section,
    check_range as check_range,
)
from .tensor_files import tensor_bytes as tensor_bytes
from .tensors import (
    concatenate as concatenate,
    mapped as mapped,
    on_device as on_device,
    put as put,
    take as take,
)
from .whole_files import (
    MOST_JSON_BYTES as MOST_JSON_BYTES,
    open_regular as open_regular,
    read_json as read_json,
    read_regular as read_regular,
    require_regular as require_regular,
)
from .workers import StoppedWatch as StoppedWatch, end_with_parent as end_with_parent
