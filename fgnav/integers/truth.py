"""Deprecated name of ``fgnav.integers.resolvers.truth``; it goes with version 0.2."""

import sys
from warnings import warn

from fgnav.integers.resolvers import truth as moved

warn("fgnav.integers.truth is now fgnav.integers.resolvers.truth", DeprecationWarning, stacklevel=2)
sys.modules[__name__] = moved
