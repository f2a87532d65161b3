"""Judging estimates: against truth, against each other, against the best that is possible."""

from fgnav.lazy import lazy

__getattr__ = lazy(__name__, {"scores": ("errors_against",)})
