"""Distances and angles that shape training data and takes alike, said once; metres and radians."""

from __future__ import annotations

import numpy as np

STAND_AHEAD = 0.45  # how far before the seated hips a person stands before sitting, metres
SEAT_MEMORY = 0.25  # the seat is sensed until its action label falls to this (published code)

# Holding a box: how far the wrists lie off its sides, behind its centre (hands reach on from them) and, as a share of its
# height, under its centre; and how far its near face is from the root of who lifts or holds it, metres.
WRIST_OFF_SIDE, WRIST_BEHIND, WRIST_BELOW = 0.03, 0.085, 0.1
BODY_TO_BOX = 0.24
# Of a box too tall or deep for that: how far the wrists are under its top and behind its near face at most, metres.
GRIP_UNDER_TOP, GRIP_IN = 0.22, 0.11
WIDEST_BOX, HEAVIEST_SIDE = 0.6, 0.6  # metres across and in depth that two hands hold
# Doors: places on the floor seen from the handle and the opening, metres.
HANDLE_STAND = 0.42  # from the closed leaf to the root of who reaches for its handle: an arm reaches low handles from here
WRIST_OFF_HANDLE = 0.03  # from where a hand holds it to the wrist
HANDLE_ASIDE = 0.25  # from the handle towards the hinge: from here straight on the way leads through the opening
PULL_BACK = 0.55  # how much further off one stands once a leaf is pulled open
PASS_BEYOND = 1.0  # from the opening to where one stands on the far side
TAKEN_AJAR = np.radians(40)  # angle of a leaf that is ajar up to which who pulls it goes round with it
OPENED = np.radians(75)  # from this angle on a pulled leaf lets a body pass
WIDE_OPEN = np.radians(95)  # where a leaf comes to rest
