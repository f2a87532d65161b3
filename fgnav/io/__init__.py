"""Files in, files out: flights as folders, RINEX, SP3, estimates as CSV."""

from fgnav.lazy import lazy

__getattr__ = lazy(
    __name__,
    {
        "flight.columns": ("FORCE", "vectors"),
        "flight.local_frame": ("place_of_n",),
        "importers.recording": ("Recording",),
    },
)
