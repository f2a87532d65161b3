"""Files in, files out: flights as folders, RINEX, SP3, logs of all kinds, estimates as tables.

What holds of all of it, so that no function repeats it:

- What is wrong with a file raises ``BadInputError``: one line with the file, the line or key, the
  rule that it breaks, the value, and the mend.
- What a file holds and is not used is counted, with its reason, as ``Unused``.
- ``t_s`` are seconds of GPS time since ``start_gps_s``, the flight's start, which counts from
  1980-01-06. Tables are columns, (k,) each, by their names in the flight format.
- Files appear whole or not at all.
"""

from fgnav.lazy import lazy

__getattr__ = lazy(
    __name__,
    {
        "flight.columns": ("FORCE", "vectors"),
        "flight.local_frame": ("place_of_n",),
        "importers.recording": ("Recording",),
    },
)
