"""The shipped weights of transitions: small, credited, and good enough to be shipped."""

from __future__ import annotations

from gaps_of_walks import walk

from nsm_core.control.inbetween import MAX_FRAMES, Gap, fill
from nsm_core.model.inference.transition_model import FILL, load_transitions


def test_shipped_weights_are_small_and_say_where_they_come_from():
    model = load_transitions()
    assert FILL.stat().st_size < 15e6
    assert model.metadata["held_out_share"] >= 0.2 and "accad_male2" in model.metadata["held_out"]
    # What interpolation has of the same gaps is 0.2085 (docs/transitions.md).
    assert model.metadata["validation"] < 0.17
    assert any("mocap.cs.cmu.edu" in line for line in model.metadata["credits"])


def test_gaps_of_every_length_are_filled_near_their_target():
    model, clip = load_transitions(), walk()
    for frames in (3, 30, MAX_FRAMES):
        filled = fill(Gap(clip[8:18], clip[18 + frames : 20 + frames], frames), model)
        assert len(filled.clip) == frames and filled.gap_before_blend < 0.1
