"""Small numbers written straight into pixels, so that a sheet needs no font."""

from __future__ import annotations

from nsm_core.rotations import Array

# Three columns by five rows, a row a digit of three bits.
_GLYPHS = {
    "0": "75557", "1": "26227", "2": "71747", "3": "71717", "4": "55711", "5": "74717",
    "6": "74757", "7": "71222", "8": "75757", "9": "75717", ".": "00002", "s": "07637",
}  # fmt: skip
_ROWS = 5


def stamp(picture: Array, text: str, size: int = 3) -> None:
    """Write ``text`` (digits, point, s) dark on a light plate into the top left of a picture (H, W, 4),
    bottom row first, in place.

    ``size`` is of one dot, pixels.
    """
    x, top = 4 * size, picture.shape[0] - 4 * size
    pad, width = 2 * size, sum(3 if c == "." else 4 for c in text) * size - size
    plate = picture[max(0, top - _ROWS * size - pad) : top + pad, max(0, x - pad) : x + width + pad, :3]
    plate += 0.7 * (1 - plate)  # readable on dark ground too
    for character in text:
        for row, digit in enumerate(_GLYPHS.get(character, "0" * _ROWS)):
            for column in range(3):
                if int(digit) >> (2 - column) & 1:
                    y = top - (row + 1) * size
                    picture[y : y + size, x + column * size : x + (column + 1) * size, :3] = (
                        0.10,
                        0.12,
                        0.16,
                    )
        x += (3 if character == "." else 4) * size
