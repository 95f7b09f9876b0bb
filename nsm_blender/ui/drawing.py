"""What the panels share: where they stand, and sentences as wide as the sidebar."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import bpy

from . import running

_PIXELS_A_LETTER = 6.5  # at a resolution scale of 1, a little more than the average letter takes
_AROUND_TEXT = 72  # pixels of the region that icon, margins and tabs take
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:s|ms|m|cm)\b)")


class Sidebar:
    """The add-on's tab in the sidebar of the 3D viewport."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "NSM"


def settings_column(layout: Any) -> Any:
    """A column of settings, their names on the left; off while a take is under way."""
    column = layout.column(align=True)
    column.enabled = running.current() is None
    column.use_property_split, column.use_property_decorate = True, False
    return column


def sentence(context: bpy.types.Context, layout: Any, text: str, icon: str) -> None:
    """Show a sentence over as many lines as the sidebar's width asks for."""
    scale = context.preferences.system.ui_scale
    width = context.region.width / scale if context.region else 300
    column = layout.column(align=True)
    column.scale_y = 0.85
    text = _BEFORE_UNIT.sub("\u00a0", text)  # a number stays on the line of its unit
    for i, line in enumerate(textwrap.wrap(text, max(int((width - _AROUND_TEXT) / _PIXELS_A_LETTER), 20))):
        column.label(text=line, icon="BLANK1" if i else icon)
