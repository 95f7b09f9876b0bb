"""How actions look in menus; by itself, since menus are there before anything else is loaded."""

from __future__ import annotations

ICONS = {
    "sit": "TRIA_DOWN_BAR",
    "walk": "TRIA_RIGHT_BAR",
    "idle": "PAUSE",
    "run": "FF",
    "carry": "PACKAGE",
    "open": "LOOP_FORWARDS",
    "climb": "TRIA_UP_BAR",
    "touch": "VIEW_PAN",
    "place": "IMPORT",
}
