"""The cheapest way over a grid, by A*."""

from __future__ import annotations

import heapq

import numpy as np

from nsm_core.rotations import Array

_DIAGONAL = 2**0.5


def cheapest(price: Array, start: tuple[int, int], goal: tuple[int, int]) -> Array | None:
    """The cheapest way (N, 2) over 8 neighbours between two cells of a grid, or None where none leads there.

    ``price`` (nx, ny) of a step by its length, 1 at least and infinite where none may go; a step costs the
    mean of its ends.
    """
    price = np.pad(price, 1, constant_values=np.inf)
    width = price.shape[1]
    first, last = ((i + 1) * width + j + 1 for i, j in (start, goal))
    prices, inf = price.ravel().tolist(), float("inf")
    if prices[first] == inf or prices[last] == inf:
        return None
    di, dj = (np.abs(np.arange(n) - at) for n, at in zip(price.shape, divmod(last, width), strict=True))
    # The least that is left to go, in two parts: of ways that cost the same the order of adding decides.
    straight = np.maximum(di[:, None], dj).ravel().tolist()
    aslant = ((_DIAGONAL - 1) * np.minimum(di[:, None], dj)).ravel().tolist()
    steps = [
        (di * width + dj, 0.5 * _DIAGONAL if di and dj else 0.5)
        for di in (-1, 0, 1)
        for dj in (-1, 0, 1)
        if di or dj
    ]
    cost, parent, done = [inf] * len(prices), [first] * len(prices), bytearray(len(prices))
    cost[first] = 0.0
    queue, push, pop = [(0.0, first)], heapq.heappush, heapq.heappop
    while queue:
        _, here = pop(queue)
        if done[here]:
            continue
        if here == last:
            break
        done[here] = 1
        base, own = cost[here], prices[here]
        for offset, length in steps:
            there = here + offset
            new = base + length * (own + prices[there])
            if new < cost[there]:  # infinite where none may go, and never less where one has been
                cost[there], parent[there] = new, here
                push(queue, (new + straight[there] + aslant[there], there))
    else:
        return None
    way = [last]
    while way[-1] != first:
        way.append(parent[way[-1]])
    return np.stack(np.divmod(np.array(way[::-1]), width), -1) - 1
