"""Learned factors from live torch modules: used, trained through the smoother, judged, exported.

Owns modules as sources of factors (``factor``, ``input_of``, ``export``), a flight's posterior that
torch differentiates (``prepare``, ``posterior``), proper scores of it (``scores``), and the judgement
of any network on flights with truth (``referee``).
"""

from typing import Any

__all__ = ["export", "factor", "input_of", "posterior", "prepare", "referee"]

_HOMES = {
    "export": "fgnav_models.learn.modules",
    "factor": "fgnav_models.learn.modules",
    "input_of": "fgnav_models.learn.modules",
    "posterior": "fgnav_models.learn.posterior",
    "prepare": "fgnav_models.learn.flights",
    "referee": "fgnav_models.learn.referee",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a name when it is first used: the referee needs no torch."""
    from importlib import import_module  # noqa: PLC0415

    if name not in _HOMES:
        msg = f"module 'fgnav_models.learn' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(_HOMES[name]), name)
