"""One file per foreign format: what it holds, as a ``Recording``."""
