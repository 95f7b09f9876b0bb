"""Inverse kinematics: limbs, feet that are planted, hands that are led, and bodies kept out of solids."""
