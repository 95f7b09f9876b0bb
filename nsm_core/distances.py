"""Distances, angles and speeds that shape training data and takes alike, said once; metres, radians, metres a
second.

Everything here is what the network has learned its goals to mean: it is written into weights when they are
trained, and weights trained under other values are told apart (``model.features.meaning``).  What shapes
takes alone stands where it is used.
"""

from __future__ import annotations

import numpy as np

# Speeds of the root at which walking begins and is complete, and the same for running: the labels of training
# data by rule, and the ramps that are proposed for captures.
IDLE_TO_WALK, WALK_TO_RUN = (0.12, 0.47), (1.8, 2.4)
# Speeds of the root at which ways of training data are walked and run.
WALKED, RUN_AT = (0.85, 1.4), (2.4, 3.6)
IDLE_PERIOD = 1.0  # seconds of a cycle of the phase where nobody moves

STAND_AHEAD = 0.45  # how far before the seated hips a person stands before sitting, metres
SEAT_MEMORY = 0.25  # the seat is sensed until its action label falls to this (published code)
# Heights of seats, metres over the floor: of surfaces that are looked for in meshes and scenes, of meshes
# that scaling can bring to where people sit, to which it brings them (the generator's own are in
# ``seating``), and to which sits of the data are moved by contact transfer.
SEATS_FOUND, SEATS_SCALABLE = (0.26, 0.88), (0.3, 0.9)
SEATS_DRAWN, SEATS_SWAPPED = (0.35, 0.55), (0.35, 0.6)
FOOT_OVER_EDGE = 0.03  # by which a foot on top of something sticks out over its edge at most, metres

# Holding a box: how far the wrists lie off its sides, behind its centre (hands reach on from them) and, as a
# share of its height, under its centre; and how far its near face is from the root of who lifts or holds it,
# metres.
WRIST_OFF_SIDE, WRIST_BEHIND, WRIST_BELOW = 0.03, 0.085, 0.1
BODY_TO_BOX = 0.24
# Sides of the boxes that are carried in training data; to deeper ones the network comes too near.
CRATE_SIDE = (0.2, 0.5)
# What the sensor reads in all cells of a box that is carried: hands hold its bounding box, so a basket is a
# full one.
BOX_READS = 1.0
# Doors: places on the floor seen from the handle and the opening, metres.
# From the closed leaf to the root of who reaches for its handle: an arm reaches low handles from here.
HANDLE_STAND = 0.42
WRIST_OFF_HANDLE = 0.03  # from where a hand holds it to the wrist
HANDLE_ASIDE = (
    0.25  # from the handle towards the hinge: from here straight on the way leads through the opening
)
PULL_BACK = 0.55  # how much further off one stands once a leaf is pulled open
PASS_BEYOND = 1.0  # from the opening to where one stands on the far side
OPENED = np.radians(75)  # from this angle on a pulled leaf lets a body pass
