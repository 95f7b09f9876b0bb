"""Axes, units, rates and orders, said once.

Metres, seconds, radians; right-handed, Z up, a character faces -Y (Blender's own convention);
quaternions are (w, x, y, z).  The network clock runs at 30 Hz.

A *root* is the planar frame under the hips: a ground position (x, y) and a heading angle.
Heading 0 faces -Y and grows counter-clockwise seen from above, so the facing direction is
``(sin(heading), -cos(heading))``.
"""

FPS = 30
DT = 1.0 / FPS

# Actions of the trajectory (styles) and of the goal; papers/000 section 3.1 and the release's order.
STYLES = ("idle", "walk", "run", "carry", "open", "sit", "climb")
GOAL_ACTIONS = ("idle", "walk", "run", "carry", "open", "sit")

# Contact order: hips, hands, feet.
CONTACTS = ("Hips", "RightWrist", "LeftWrist", "RightAnkle", "LeftAnkle")

# Places of what the rules ask about: labels of the trajectory, the hip contact, the hands' and the feet's
# contacts right then left.
IDLE, WALK, RUN, CARRY, OPEN, SIT, CLIMB = (
    STYLES.index(name) for name in ("idle", "walk", "run", "carry", "open", "sit", "climb")
)
INTERACTIONS = [CARRY, OPEN, SIT, CLIMB]  # labels of actions that have an object
HIP_CONTACT = CONTACTS.index("Hips")
HAND_CONTACTS = [CONTACTS.index("RightWrist"), CONTACTS.index("LeftWrist")]
FOOT_CONTACTS = [CONTACTS.index("RightAnkle"), CONTACTS.index("LeftAnkle")]
