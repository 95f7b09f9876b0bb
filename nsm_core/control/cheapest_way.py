"""The cheapest way over a grid, by A*."""

from __future__ import annotations

import heapq

import numpy as np

from ..rotations import Array

_DIAGONAL = 2**0.5


def cheapest(price: Array, start: tuple[int, int], goal: tuple[int, int]) -> Array | None:
    """The cheapest way (N, 2) over 8 neighbours between two cells of a grid, or None where none leads there.

    ``price`` (nx, ny) of a step by its length, 1 at least and infinite where none may go; a step costs the mean of its ends.
    """
    price = np.pad(price, 1, constant_values=np.inf)
    width = price.shape[1]
    first, last = ((i + 1) * width + j + 1 for i, j in (start, goal))
    prices, inf = price.ravel().tolist(), float("inf")
    if prices[first] == inf or prices[last] == inf:
        return None
    gi, gj = divmod(last, width)
    steps = [(di * width + dj, _DIAGONAL if di and dj else 1.0) for di in (-1, 0, 1) for dj in (-1, 0, 1) if di or dj]
    cost, parent, done = [inf] * len(prices), [first] * len(prices), bytearray(len(prices))
    cost[first] = 0.0
    queue = [(0.0, first)]
    while queue:
        _, here = heapq.heappop(queue)
        if done[here]:
            continue
        if here == last:
            break
        done[here] = 1
        base, own = cost[here], prices[here]
        for offset, length in steps:
            there = here + offset
            p = prices[there]
            if p == inf or done[there]:
                continue
            new = base + length * 0.5 * (own + p)
            if new < cost[there]:
                cost[there], parent[there] = new, here
                i, j = divmod(there, width)
                di, dj = abs(i - gi), abs(j - gj)
                heapq.heappush(queue, (new + max(di, dj) + (_DIAGONAL - 1) * min(di, dj), there))
    else:
        return None
    way = [last]
    while way[-1] != first:
        way.append(parent[way[-1]])
    return np.stack(np.divmod(np.array(way[::-1]), width), -1) - 1
