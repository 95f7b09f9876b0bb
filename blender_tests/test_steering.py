"""Steering by keys: a scripted list of key states is recorded, solved, keyed; ESC puts everything back."""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np
import pytest
from scenes import furnish

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.report import result_lines
from nsm_blender.prepare import TakeSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.steering import Controls, steer
from nsm_blender.takes import Take
from nsm_blender.ui.operators.steer import heading_of_view
from nsm_blender.ui.session import TakeSession

STOPPED = "Recording stopped and nothing was keyed"


class Clock:
    """Every look at it is a frame later."""

    now = 0.0

    def __call__(self) -> float:
        self.now += 1 / 30
        return self.now


def recording(goals=()) -> tuple[TakeSession, Controls]:
    controls = Controls(clock=Clock())
    spec = TakeSpec(add_character(), list(goals), start_frame=11)
    steps = partial(steer, controls=controls)
    return TakeSession(spec, bpy.context.scene, None, steps, STOPPED), controls


def play(session: TakeSession, controls: Controls, script: dict[int, str]) -> Take | None:
    """Press ("+W") and let go ("-W") keys at frames of the recording, to its end or to the script's."""
    frame = 0
    while frame <= max(script):
        if session.text.startswith("Recording"):
            for key in script.get(frame, "").split():
                controls.event(key[1:], "PRESS" if key[0] == "+" else "RELEASE")
            frame += 1
        session.tick(0.03)
    while controls.over and not session.over:
        session.tick(0.03)
    return session._value


def test_a_script_of_keys_is_keyed_like_any_take():
    furnish("chair", "Chair", (0.9, -2.2), 0.3)
    session, controls = recording([GoalSpec("sit", bpy.data.objects["Chair"])])
    take = play(
        session, controls, {2: "+W", 60: "+LEFT_SHIFT", 100: "-LEFT_SHIFT -W +ONE", 430: "+A", 500: "+RET"}
    )
    assert session.over and not session.why
    walk, sit, leave = take.report["goals"]
    assert (walk["reached"], sit["reached"], leave["reached"]) == (True, True, True)
    assert sit["position_error_cm"] < 3.0 and take.report["top_speed_m_s"] > 1.8
    texts = [text for text, good in result_lines(take.report, take.keyed.frame_start) if good]
    assert (
        "Keyboard: steered for 3" in texts[0]
        and "sat down" in texts[1]
        and "Keys on frames 11 to" in texts[3]
    )
    root = take.result.root
    assert root[100, 1] < -2.5 and root[-1, 0] - root[430, 0] > 0.5, "A goes to the left of a view along -Y"
    assert take.keyed.frame_start == 11 and take.report["frames"] >= 400, "at 24 frames a second"


def test_escape_puts_everything_back():
    session, controls = recording()
    character = session.character
    bones = np.array([b.matrix for b in character.pose.bones])
    play(session, controls, {2: "+W", 25: ""})
    bpy.context.view_layer.update()
    assert np.abs(np.array([b.matrix for b in character.pose.bones]) - bones).max() > 0.1, "it is shown"
    session.cancel()
    bpy.context.view_layer.update()
    assert np.abs(np.array([b.matrix for b in character.pose.bones]) - bones).max() < 1e-6
    assert not bpy.data.actions and "Recording was cancelled" in session.why


@pytest.mark.parametrize(
    ("right", "heading"),
    [((1, 0, 0), np.pi), ((-1, 0, 0), 0.0), ((0, 1, 0), -np.pi / 2), ((0, -0.7, 0.7), np.pi / 2)],
)
def test_ahead_is_where_the_camera_looks(right, heading):
    assert np.cos(heading_of_view(right) - heading) == pytest.approx(1.0)


class Seen:
    """What keys may ask of a take that is steered."""

    heading = 0.3

    def __init__(self) -> None:
        from nsm_core.control.goals import Steering

        self.steering = Steering()


def test_keys_and_what_they_ask_for():
    controls, live = Controls(active=2), Seen()
    controls.view = np.pi  # the front view looks along +Y
    assert controls.event("W", "PRESS") and controls.event("D", "PRESS") and controls.steers
    controls.lead(live)
    assert live.steering.velocity == pytest.approx(live.steering.speed * np.array((1, 1)) / np.sqrt(2))
    slow = live.steering.speed
    controls.event("LEFT_SHIFT", "PRESS")
    controls.lead(live)
    assert live.steering.speed > 2 * slow
    controls.event("WINDOW_DEACTIVATE", "NOTHING")
    controls.lead(live)
    assert live.steering.speed == 0 and not controls.steers and live.steering.heading is None
    controls.event("Q", "PRESS")
    controls.lead(live)
    assert 0.3 < live.steering.heading < 0.5
    for _ in range(60):
        controls.lead(live)
    assert live.steering.heading == pytest.approx(1.5), "a turn is led no further ahead than a body follows"
    controls.event("Q", "RELEASE"), controls.event("Q", "CLICK")
    assert not controls.steers and not controls.event("X", "PRESS")
    controls.event("G", "PRESS")
    assert controls.asked() == 2 and controls.asked() is None
    controls.event("SPACE", "PRESS")
    assert controls.over
