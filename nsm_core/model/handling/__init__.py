"""The controller of picking and placing (papers/002 section 5): phases, and a Kalman filter on the goal's."""
