"""GTSAM where it is installed; in its place, where not, what says so when it is called.

GTSAM has no wheel for Windows. The compiled chain then solves the same problem: modules that name
GTSAM's types can be imported, and whoever calls one gets the mend.
"""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NoReturn

from fgnav.checks import BadInputError

HAS_GTSAM = find_spec("gtsam") is not None
ABSENT = "gtsam is not installed (it has no wheel for Windows); solver chain does without it"


class _Absent(type):
    """A class of a package that is not installed: it can be named, not made."""

    def __getattr__(cls, name: str) -> "_Absent":
        """Return what stands for an attribute: a class of a class, a function."""
        if name.startswith("__"):
            raise AttributeError(name)
        return _Absent(name, (), {})

    def __call__(cls, *_: Any, **__: Any) -> NoReturn:  # noqa: ANN401
        """Say what is missing.

        Raises
        ------
        BadInputError
            Always.
        """
        raise BadInputError(ABSENT)


if TYPE_CHECKING or HAS_GTSAM:
    import gtsam
else:
    gtsam = _Absent("gtsam", (), {})

__all__ = ["ABSENT", "HAS_GTSAM", "gtsam"]
