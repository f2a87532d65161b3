"""Vehicles as rigid bodies: what their files say, forces, air, and how they fly."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what an editor and a type checker see
    from fgnav_sim.vehicle.tables import load_vehicle

__all__ = ["load_vehicle"]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load the reader of vehicle files when it is first used."""
    if name == "load_vehicle":
        from fgnav_sim.vehicle.tables import load_vehicle  # noqa: PLC0415  # lazy

        return load_vehicle
    msg = f"module 'fgnav_sim.vehicle.tables' has no attribute {name!r}"
    raise AttributeError(msg)
