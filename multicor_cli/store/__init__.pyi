from .checkpoint import Checkpoint as Checkpoint
from .errors import (
    DamagedRun as DamagedRun,
)
from .errors import (
    DirectoryRefused as DirectoryRefused,
)
from .errors import (
    RunLocked as RunLocked,
)
from .errors import (
    StorageError as StorageError,
)
from .errors import (
    StorageFull as StorageFull,
)
from .errors import (
    StoreError as StoreError,
)
from .errors import (
    UnsupportedVersion as UnsupportedVersion,
)
from .frame_view import Contacts as Contacts
from .frame_view import Frame as Frame
from .frame_view import Frames as Frames
from .info import run_info as run_info
from .provenance import collect_provenance as collect_provenance
from .reader import Run as Run
from .reader import Series as Series
from .reader import open_run as open_run
from .rundir import RunDirectory as RunDirectory
from .segments import FrameWriter as FrameWriter
from .snapshot import Snapshot as Snapshot
from .summary import summarize as summarize
from .verification import FileFinding as FileFinding
from .verification import verify as verify
