"""Learned factors from live torch modules: a module as a source of factors, and its export."""

from fgnav_models.learn.modules import export, factor, input_of

__all__ = ["export", "factor", "input_of"]
