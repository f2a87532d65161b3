"""Contents of a flight and mistakes of its set-up, found in closed form before any estimate."""

from fgnav.diagnostics.contents import Diagnosis, Finding, Series
from fgnav.diagnostics.corrections import Corrected, corrected_set_up
from fgnav.diagnostics.describe import describe

__all__ = ["Corrected", "Diagnosis", "Finding", "Series", "corrected_set_up", "describe"]
