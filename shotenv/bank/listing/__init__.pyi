from .contact_sheets import contact_sheet as contact_sheet
from .contents import (
    contents_at as contents_at,
    contents_of as contents_of,
    known_banks as known_banks,
    print_banks as print_banks,
    print_contents as print_contents,
)
