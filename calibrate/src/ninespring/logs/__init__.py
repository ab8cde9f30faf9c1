"""Logs (docs/files.md): reading, checking, mending, writing."""

from .condense import condense as condense
from .log import COLUMN as COLUMN
from .log import EXTRA as EXTRA
from .log import LIMITS as LIMITS
from .log import MAX_SPRINGS as MAX_SPRINGS
from .log import read_log as read_log
from .run import DriveMode as DriveMode
from .run import Run as Run
from .table import Table as Table
from .table import read_table as read_table
from .writing import check_folder as check_folder
from .writing import log_text as log_text
from .writing import read_bytes as read_bytes
from .writing import sha256_of as sha256_of
from .writing import write_atomically as write_atomically
