"""Flights of stairs as furniture: a box for each tread, and one for the landing."""

from __future__ import annotations

from nsm_core.world.scene.stairs import Flight

from .piece import Furniture, Part, build


def flight_piece(
    flight: Flight, landing: tuple[float, float] = (1.2, 0.0), plate: float | None = None
) -> Furniture:
    """The solids of a flight, over the ground before it; origin at its foot, rising towards +Y.

    ``landing`` metres ahead of the highest riser, and that it is wider than the flight to either side.
    ``plate``: treads and landing are plates of that thickness, metres; None: they are solid down to the
    ground.
    """
    x, boxes = flight.width / 2, list[Part]()
    for k in range(1, flight.steps):
        low = 0.0 if plate is None else max(0.0, k * flight.riser - plate)
        boxes.append((-x, x, (k - 1) * flight.tread, k * flight.tread, low, k * flight.riser))
    low = 0.0 if plate is None else flight.rise - plate
    ahead, aside = landing
    boxes.append((-x - aside, x + aside, flight.length, flight.length + ahead, low, flight.rise))
    return build("stairs", boxes, centred=False)


__all__ = ["flight_piece"]
