"""Pack a training for another machine: code, captures and objects in one folder, with one script that
composes, trains, evaluates and leaves the weights in pieces; and join those pieces again.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import shutil
import tarfile
from pathlib import Path

from nsm_core.errors import OutputError, WeightsError
from nsm_core.files import output
from nsm_core.model.inference.weights_file import load_weights

PIECE_MB = 16.0
SUMS = "pieces.txt"  # beside the pieces: their names and checksums, in order
_EVALUATION = """python3 -m nsm_core evaluate --weights run/nsm.npz --only sit,carry,travel \\
  --starts {starts} --workers "$cores" --no-ablation --out ../out/evaluation.json | tee ../out/evaluation.txt
"""
_SCRIPT = """#!/usr/bin/env bash
# Composes, trains and evaluates; out/ then holds the weights in pieces, the log and the figures.
# A run that breaks off is taken up again by the same command.
set -euo pipefail
cd "$(dirname "$0")"
mkdir -p work out
[ -d work/nsm_core ] || tar -xf code.tar.gz -C work
[ -d work/captures ] || tar -xf captures.tar.gz -C work
{unpack_objects}cd work
cores="$(python3 -c 'import os; print(os.cpu_count())')"
device="$(python3 -c 'import torch; print("cuda" if torch.cuda.is_available() else "cpu")')"
echo "Training on $device, with $cores cores."
[ -f run/data/data.json ] || python3 -m nsm_core compose captures {objects}--out run/data \\
  --minutes {data_minutes:g} --workers "$cores"
python3 -m nsm_core train captures {objects}--run run --data run/data --device "$device" \\
  --threads "$cores" --minutes {minutes:g} {options}
python3 -m nsm_core pack --pieces run/nsm.npz --out ../out --piece-mb {piece:g}
cp run/log.csv ../out/
{evaluation}"""


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core pack``."""
    parser = argparse.ArgumentParser(prog="pack", description="Pack a training for another machine.")
    parser.add_argument("captures", nargs="?", help="folder with BVH captures")
    parser.add_argument("--objects", default=None, help="folder of furniture meshes")
    parser.add_argument("--out", default="runs/elsewhere", help="folder that is written")
    parser.add_argument("--minutes", type=float, default=8.0, help="minutes of training")
    parser.add_argument("--data-minutes", type=float, default=120.0, help="minutes of composed takes")
    parser.add_argument(
        "--starts", type=int, default=4, help="starts for each object that is tried (0: none)"
    )
    parser.add_argument("--start-from", default=None, help="weights file whose network to start from")
    parser.add_argument("--options", default="", help="more options of train, in one string")
    parser.add_argument("--piece-mb", type=float, default=PIECE_MB, help="size of a piece of the weights")
    parser.add_argument("--pieces", default=None, metavar="WEIGHTS", help="only cut this file into pieces")
    parser.add_argument("--join", default=None, metavar="FOLDER", help="only join the pieces of a folder")
    parser.add_argument("--weights", default="nsm.npz", help="file that --join writes")
    a = parser.parse_args(arguments)
    if a.join is not None:
        print(f"Wrote {join(Path(a.join), Path(a.weights))}.")
        return 0
    if a.pieces is not None:
        made = cut(Path(a.pieces), Path(a.out), a.piece_mb)
        print(f"Wrote {len(made)} pieces into {a.out}.")
        return 0
    if a.captures is None:
        parser.error("name the folder with the captures")
    folder = pack(
        Path(a.captures),
        Path(a.out),
        None if a.objects is None else Path(a.objects),
        None if a.start_from is None else Path(a.start_from),
        minutes=a.minutes,
        data_minutes=a.data_minutes,
        starts=a.starts,
        options=a.options,
        piece=a.piece_mb,
    )
    size = sum(p.stat().st_size for p in folder.iterdir()) / 2**20
    print(f"Wrote {folder} ({size:.0f} MB); run {folder / 'train.sh'} where it is taken to.")
    return 0


def pack(
    captures: Path,
    out: Path,
    objects: Path | None = None,
    start: Path | None = None,
    *,
    minutes: float,
    data_minutes: float,
    starts: int,
    options: str = "",
    piece: float = PIECE_MB,
) -> Path:
    """Write ``out`` with all that ``train.sh`` in it needs beside Python, PyTorch and the packages of the
    training extra; OutputError where something is missing.
    """
    for folder, what in ((captures, "captures"), (objects, "meshes")):
        if folder is not None and not folder.is_dir():
            raise OutputError(f"There is no folder {folder} with {what} to pack; name another.")
    out.mkdir(parents=True, exist_ok=True)
    code = Path(__file__).resolve().parents[1]
    _tar(out / "code.tar.gz", code, "nsm_core")
    _tar(out / "captures.tar.gz", captures, "captures")
    if objects is not None:
        _tar(out / "objects.tar.gz", objects, "objects")
    if start is not None:
        load_weights(start)  # a bad file is told here, not elsewhere
        shutil.copyfile(start, out / "start.npz")
        options += " --start-from ../start.npz"
    script = _SCRIPT.format(
        unpack_objects="" if objects is None else "[ -d work/objects ] || tar -xf objects.tar.gz -C work\n",
        objects="" if objects is None else "--objects objects ",
        data_minutes=data_minutes,
        minutes=minutes,
        options=options.strip(),
        piece=piece,
        evaluation=_EVALUATION.format(starts=starts) if starts > 0 else "",
    )
    with output(out / "train.sh", "The script") as beside:
        beside.write_text(script, encoding="utf-8", newline="\n")
    (out / "train.sh").chmod(0o755)
    return out


def cut(weights: Path, folder: Path, piece_mb: float = PIECE_MB) -> list[Path]:
    """Cut a weights file into pieces of so many megabytes, with their checksums beside them."""
    load_weights(weights)
    folder.mkdir(parents=True, exist_ok=True)
    data, size, made, sums = weights.read_bytes(), max(1, round(piece_mb * 2**20)), [], []
    for number, start in enumerate(range(0, len(data), size)):
        part = data[start : start + size]
        made.append(folder / f"weights.{number:03d}")
        made[-1].write_bytes(part)
        sums.append(f"{hashlib.sha256(part).hexdigest()} {made[-1].name}")
    (folder / SUMS).write_text("\n".join(sums) + "\n", encoding="utf-8")
    return made


def join(folder: Path, weights: Path) -> Path:
    """Join the pieces of a folder to a weights file; WeightsError names the piece that is missing or
    damaged.
    """
    if not (folder / SUMS).is_file():
        raise WeightsError(f"{folder} holds no {SUMS}; bring back the whole folder 'out'.")
    whole = io.BytesIO()
    for line in (folder / SUMS).read_text(encoding="utf-8").splitlines():
        wanted, _, name = line.partition(" ")
        piece = folder / Path(name).name
        if not piece.is_file():
            raise WeightsError(f"The piece {piece.name} is missing from {folder}; bring it back, too.")
        part = piece.read_bytes()
        if hashlib.sha256(part).hexdigest() != wanted:
            raise WeightsError(f"The piece {piece.name} in {folder} is damaged; bring it back again.")
        whole.write(part)
    with output(weights, "The weights") as beside:
        beside.write_bytes(whole.getvalue())
        load_weights(beside)
    return weights


def _tar(target: Path, folder: Path, name: str) -> None:
    """Pack a folder under another name, without what Python leaves about."""

    def kept(entry: tarfile.TarInfo) -> tarfile.TarInfo | None:
        entry.uid = entry.gid = 0
        entry.uname = entry.gname = ""
        return None if "__pycache__" in entry.name else entry

    with output(target, "The package") as beside, tarfile.open(beside, "w:gz") as tar:
        tar.add(folder, arcname=name, filter=kept)
