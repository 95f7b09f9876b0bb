"""The add-on's tab in the sidebar of the 3D viewport: its panels, in the order of the work.

Each panel stands in a file of its own and shows what others have computed.  Panels of further parts hang
below one of these by its ``bl_idname`` (``bl_parent_id``) and are named in ``CLASSES`` after it.
"""

from __future__ import annotations

import bpy

from .. import warm_up
from . import running
from .bones_panel import NSM_PT_bones
from .character_panel import NSM_PT_character
from .drawing import Sidebar
from .fill_panel import NSM_PT_fill
from .generate_panel import NSM_PT_generate
from .goals_panel import NSM_MT_queues, NSM_PT_goals, NSM_UL_goals
from .keys_panel import NSM_PT_keys
from .overlays_panel import NSM_PT_overlays
from .properties import settings_of
from .queue import queue_of
from .takes_panel import NSM_PT_takes, NSM_UL_takes


class NSM_PT_motion(Sidebar, bpy.types.Panel):
    """The head of the tab: how far a take is, whichever panels are folded."""

    bl_label = "Character Motion"
    bl_idname = "NSM_PT_motion"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        self.layout.operator("nsm.help", text="", icon="HELP", emboss=False)

    def draw(self, context: bpy.types.Context) -> None:
        character = settings_of(context.scene).character
        warm_up.begin(network=character is not None and len(queue_of(context.scene).goals) > 0)
        state = running.current()
        if state is not None:
            self.layout.progress(factor=state.fraction, text=state.text)
            self.layout.label(text="ESC cancels and puts everything back", icon="INFO")
        elif character is None:
            self.layout.operator("nsm.example", icon="HOME")


CLASSES = (
    NSM_MT_queues,
    NSM_UL_goals,
    NSM_UL_takes,
    NSM_PT_motion,
    NSM_PT_character,
    NSM_PT_bones,
    NSM_PT_goals,
    NSM_PT_generate,
    NSM_PT_keys,
    NSM_PT_fill,
    NSM_PT_takes,
    NSM_PT_overlays,
)
