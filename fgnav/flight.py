"""Deprecated name of ``fgnav.types.flight``; it goes with version 0.2."""

import sys
from warnings import warn

from fgnav.types import flight as moved

warn("fgnav.flight is now fgnav.types.flight", DeprecationWarning, stacklevel=2)
sys.modules[__name__] = moved
