"""What looks solid in the viewport is, and the animator's word wins over looks."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from colliders_now import gather_colliders
from crates import crate, names
from scenes import box, furnish

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, generate, prepare
from nsm_core.errors import GoalError

pytestmark = pytest.mark.usefixtures("nothing_read_before")


def material(name, surface, volume):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    for wanted, kind, socket in (
        (surface, "ShaderNodeBsdfDiffuse", "Surface"),
        (volume, "ShaderNodeVolumePrincipled", "Volume"),
    ):
        if wanted:
            tree.links.new(tree.nodes.new(kind).outputs[0], output.inputs[socket])
    return made


class TestWhatIsSolid:
    def test_what_is_seen_as_solid_in_the_viewport(self):
        looks = {
            "wire": lambda o: setattr(o, "display_type", "WIRE"),
            "bounds": lambda o: setattr(o, "display_type", "BOUNDS"),
            "fog": lambda o: o.data.materials.append(material("Fog", False, True)),
            "glass with fog": lambda o: o.data.materials.append(material("Both", True, True)),
            "glass beside fog": lambda o: [
                o.data.materials.append(material(n, n == "a", n == "b")) for n in "ab"
            ],
            "without a material": lambda o: o.data.materials.append(None),
            "held out": lambda o: setattr(o, "is_holdout", True),
            "not in renders": lambda o: setattr(o, "hide_render", True),
            "not for the camera": lambda o: setattr(o, "visible_camera", False),
            "hidden": lambda o: o.hide_set(True),
        }
        for i, (name, change) in enumerate(looks.items()):
            change(crate(name, i))
        assert names() == sorted(looks.keys() - {"wire", "bounds", "fog", "hidden"})

    def test_the_animators_word_wins_over_looks(self):
        for said in (True, False):
            for i, look in enumerate(("SOLID", "WIRE")):
                made = crate(f"{look} {said}", 2 * i + said)
                made.display_type, made["nsm_collider"] = look, said
        crate("hidden eye", 5)["nsm_collider"] = True
        crate("hidden screen", 6)["nsm_collider"] = 1
        bpy.data.objects["hidden eye"].hide_set(True)
        bpy.data.objects["hidden screen"].hide_viewport = True
        assert names() == ["SOLID True", "WIRE True", "hidden eye", "hidden screen"]
        d = gather_colliders(bpy.context.scene).signed_distance(
            np.array(((5.9, 0.4, 0.4), (5.4, 0.4, 0.4)), np.float32), 0.5
        )
        np.testing.assert_allclose(d, (0.1, -0.4), atol=1e-5)

    def test_the_message_names_what_stands_in_the_way(self):
        seat, _ = furnish()
        helper = box("Helper", (-1, -1.2, -0.1), (1, 1.2, 2.2))
        spec = TakeSpec(add_character((2.5, -2, 0)), [GoalSpec("sit", seat)])
        with pytest.raises(GoalError, match="'Helper' stands in it.*nsm_collider"):
            finish(generate(spec, bpy.context.scene))
        helper["nsm_collider"] = False
        assert (
            finish(prepare(spec, bpy.context.scene))[0].environment.signed_distance(
                np.array(((1.0, 0, 1),), np.float32), 0.1
            )
            > 0
        )
