"""Judging estimates: against truth, against each other, against the best that is possible."""

from fgnav.lazy import lazy

__getattr__ = lazy(
    __name__, {"networks": ("calibration", "referee"), "scores": ("errors_against",)}
)
