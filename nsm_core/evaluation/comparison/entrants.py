"""Who is compared, how each is trained, and what the paper says of it (papers/000 tables 2 and 3)."""

from __future__ import annotations

from dataclasses import dataclass

RESPONSES = ("idle_to_walk_s", "idle_to_run_s", "walk_to_sit_s", "run_to_sit_s")
_NAN = float("nan")


@dataclass(frozen=True)
class Entrant:
    """One that is compared: ``arguments`` of its training, none for what plays captures.

    ``response`` are the paper's seconds as in ``RESPONSES``, ``precision`` its sit PE cm and RE deg and carry
    PE and RE.
    """

    key: str
    title: str
    arguments: tuple[str, ...] = ()
    response: tuple[float, ...] = ()
    precision: tuple[float, ...] = ()
    captured: bool = False
    stitched: bool = True  # on the data that all others are trained on


def _network(key: str, title: str, response: tuple[float, ...], precision: tuple[float, ...]) -> Entrant:
    return Entrant(key, title, ("--network", key), response, precision)


NETWORKS = (
    Entrant("nsm", "NSM", (), (1.49, 0.81, 4.92, 5.10), (2.93, 0.92, 3.05, 1.02)),
    _network("mlp", "MLP", (1.75, 1.35, 5.05, 5.13), (14.05, 4.11, 6.27, 3.46)),
    _network("pfnn", "PFNN", (1.50, 0.87, 4.95, 5.32), (7.66, 3.31, 10.35, 4.83)),
    _network("mann", "MANN", (1.83, 0.92, 4.85, 5.30), (5.54, 1.87, 3.41, 1.79)),
    _network("lstm", "LSTM", (), ()),
    _network("auto_lstm", "Auto-LSTM", (1.86, 1.82, 5.53, _NAN), (5.23, 2.70, 5.59, 3.77)),
    Entrant("nsm-one-step", "NSM, one-step training", ("--one-step",)),
    Entrant(
        "lstm-one-step",
        "LSTM, one-step training",
        ("--network", "lstm", "--one-step"),
        (2.16, 2.24, 5.62, _NAN),
        (6.14, 2.05, 6.11, 3.02),
    ),
)
ABLATIONS = (
    Entrant(
        "no-bi-directional",
        "without bi-directional control",
        ("--blending", "none"),
        precision=(4.27, 1.58, 3.41, 1.73),
    ),
    Entrant("trajectory-alone", "trajectory control alone", ("--blending", "trajectory")),
    Entrant("pose-alone", "pose control alone", ("--blending", "pose")),
    Entrant(
        "no-interaction-sensor",
        "without interaction sensor",
        ("--without", "interaction"),
        precision=(3.72, 1.11, 6.09, 2.26),
    ),
    Entrant(
        "no-environment-sensor",
        "without environment sensor",
        ("--without", "environment"),
        precision=(3.05, 0.94, 8.52, 2.27),
    ),
    Entrant("pae-phase", "measured phase", ("--phase", "pae", "--fresh", "0")),
    Entrant("no-stitching", "without stitching", ("--no-stitching",), stitched=False),
    Entrant("no-augmentation", "without augmentation", ("--fresh", "0")),
    *(Entrant(f"experts-{k}", f"K = {k}", ("--experts", str(k))) for k in (1, 4, 10)),
)
_PLAIN = ("--network", "nsm_concatenated")
# What the gating network reads beside or times the phase (Fig. 12); all of it times the phase is NSM.
GATES = (
    Entrant("kronecker-labels", "labels [K]", ("--without", "gate_goals")),
    Entrant("kronecker-goals", "labels, goals [K]", ("--without", "gate_distances")),
    Entrant("concatenated-labels", "labels [C]", (*_PLAIN, "--without", "gate_goals")),
    Entrant("concatenated-goals", "labels, goals [C]", (*_PLAIN, "--without", "gate_distances")),
    Entrant("concatenated", "labels, goals, distances [C]", _PLAIN),
)
CAPTURED = (
    Entrant("clips", "clip, root warp, IK", captured=True),
    Entrant("matching", "motion matching", captured=True),
)
ENTRANTS = {e.key: e for e in (*NETWORKS, *ABLATIONS, *GATES, *CAPTURED)}
