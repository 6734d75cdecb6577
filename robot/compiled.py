"""One way to compile the functions of the control path.

numba's own cache does not notice a change in a *called* function, so the cache stands in a folder
named after the contents of this package and the versions of what it is compiled with: a change
anywhere compiles anew, an unchanged checkout never does.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import llvmlite
import numba
import numpy as np

_Function = TypeVar("_Function", bound=Callable[..., object])


def cache_directory() -> Path:
    """Folder of the compiled functions for this source, interpreter, numba and numpy."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.name.encode() + source.read_bytes())
    for version in (sys.version, numba.__version__, llvmlite.__version__, np.__version__):
        digest.update(version.encode())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    root = Path(home) / "keyhole" / "compiled"
    if not os.access(root.parent.parent if root.parent.parent.exists() else Path.home(), os.W_OK):
        root = Path(tempfile.gettempdir()) / f"keyhole-compiled-{os.getuid()}"
    return root / digest.hexdigest()[:16]


numba.config.CACHE_DIR = str(cache_directory())  # type: ignore[attr-defined]


def compiled(function: _Function) -> _Function:
    """Compile ``function`` on first use, with the cache above and IEEE arithmetic kept exact."""
    return cast(_Function, numba.njit(cache=True, fastmath=False, error_model="numpy")(function))
