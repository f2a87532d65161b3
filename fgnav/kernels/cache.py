"""Cache of compiled kernels: a folder of this process' own where numba can write no other.

Without one, numba refuses to compile at all. It writes beside the sources, else in the user's cache
folder; ``NUMBA_CACHE_DIR`` overrides both.
"""

import atexit
import logging
import os
import shutil
import tempfile
from pathlib import Path

_VARIABLE = "NUMBA_CACHE_DIR"


def ensure_kernel_cache(sources: Path) -> None:
    """Name a temporary folder, and say so, where numba could write nowhere."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111  # no error without a home
    folders = (sources / "__pycache__", Path(home) / "numba")
    if os.environ.get(_VARIABLE) or any(map(_is_writable, folders)):
        return
    folder = tempfile.mkdtemp(prefix="fgnav-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[_VARIABLE] = folder
    logging.getLogger("fgnav").warning(
        "compiled code cannot be kept in %s: it lasts as long as this process, and the next one "
        "compiles again; %s names a folder for it",
        " or ".join(map(str, folders)),
        _VARIABLE,
    )


def _is_writable(folder: Path) -> bool:
    """Tell whether files can be made in a folder, as numba does: by making one."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
