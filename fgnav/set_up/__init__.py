"""What a flight holds and what is wrong with its set-up, by name, before it is estimated."""

from fgnav.set_up.describe import describe
from fgnav.set_up.findings import Finding, Series, SetUp

__all__ = ["Finding", "Series", "SetUp", "describe"]
