"""Small numbers written straight into pixels, so that a sheet needs no font."""

from __future__ import annotations

from nsm_core.rotations import Array

# Three columns by five rows, a row a digit of three bits.
_GLYPHS = {
    "0": "75557", "1": "26227", "2": "71747", "3": "71717", "4": "55711", "5": "74717",
    "6": "74757", "7": "71222", "8": "75757", "9": "75717", ".": "00002", "s": "07637",
}  # fmt: skip
_ROWS = 5


def stamp(picture: Array, text: str, size: int = 3, margin: int = 9) -> None:
    """Write ``text`` (digits, point, s) dark into the top left of a picture (H, W, 4), bottom row first, in place."""
    x, top = margin, picture.shape[0] - margin
    for character in text:
        for row, digit in enumerate(_GLYPHS.get(character, "0" * _ROWS)):
            for column in range(3):
                if int(digit) >> (2 - column) & 1:
                    y = top - (row + 1) * size
                    picture[y : y + size, x + column * size : x + (column + 1) * size, :3] = (0.10, 0.12, 0.16)
        x += (3 if character == "." else 4) * size
