"""Deprecated name of ``fgnav.io.flight.folder``; it goes with version 0.2."""

import sys
from warnings import warn

from fgnav.io.flight import folder as moved

warn("fgnav.io.flight_folder is now fgnav.io.flight.folder", DeprecationWarning, stacklevel=2)
sys.modules[__name__] = moved
