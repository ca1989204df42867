from .fetching import damaged_files as damaged_files, fetch as fetch
from .listing import (
    Listing as Listing,
    StoredFile as StoredFile,
    require_storable as require_storable,
)
from .place import (
    Place as Place,
    StorageError as StorageError,
    is_url as is_url,
    require_plain as require_plain,
)
from .publishing import (
    find_part as find_part,
    place_to_publish as place_to_publish,
    publish_contents as publish_contents,
    publish_part as publish_part,
    read_contents as read_contents,
    standing_parts as standing_parts,
)
