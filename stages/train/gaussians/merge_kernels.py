"""The loops of `merge`: few long ones, since beside busy threads each of numpy's short ones waits for the interpreter's lock."""

from __future__ import annotations

import numpy as np

from gsac.avatar.numba_kernel import own_kernel


@own_kernel(nogil=True, error_model="numpy")
def weigh_pairs(near, face, R, skin, rgb, places, shown, size, same_side, same_part, even):
    """Each two neighbours of one side and one part once, (P, 2), ascending, and the cost (P,) of merging them.

    near: (N, K) indices; face: (N,); R: (F, 3, 3) of the faces' frames; skin: (F, J) weights; rgb: (N, 3); places: (N, 3) m;
    shown: (N,) pixels; size: of a mean gaussian, m2; same_side, same_part, even: as in `merge`.
    """
    count, width = near.shape
    start = np.zeros(count + 1, np.int64)
    for i in range(count):
        for k in range(width):
            start[min(i, near[i, k]) + 1] += 1
    for i in range(count):
        start[i + 1] += start[i]
    others, end = np.empty(count * width, np.int64), start[:-1].copy()
    for i in range(count):
        for k in range(width):
            first, other = min(i, near[i, k]), max(i, near[i, k])
            at = end[first]
            while at > start[first] and others[at - 1] > other:  # the others of each in ascending order
                others[at] = others[at - 1]
                at -= 1
            others[at] = other
            end[first] += 1
    pairs, cost, found = np.empty((count * width, 2), np.int64), np.empty(count * width), 0
    for one in range(count):
        for at in range(start[one], start[one + 1]):
            other = others[at]
            if other == one or (at > start[one] and other == others[at - 1]):
                continue
            mine, its = face[one], face[other]
            alike, colour, way, apart = np.float32(0), 0.0, 0.0, 0.0
            for c in range(3):
                alike += R[mine, c, 1] * R[its, c, 1]
            if not alike > same_side:
                continue
            if mine != its:
                for joint in range(skin.shape[1]):
                    apart += abs(skin[mine, joint] - skin[its, joint])
            if not 0.5 * apart < same_part:
                continue
            for c in range(3):
                colour += (np.float64(rgb[one, c]) - rgb[other, c]) ** 2
                way += (places[one, c] - places[other, c]) ** 2
            pairs[found, 0], pairs[found, 1] = one, other
            cost[found] = shown[one] * shown[other] / (shown[one] + shown[other]) * (colour + even**2 * (way / size))
            found += 1
    return pairs[:found], cost[:found]


@own_kernel(nogil=True)
def take_free(pairs, order, most, free):
    """(M, 2) of pairs (P, 2) in an order, (Q,) indices, at most `most`: those of which neither is in one taken before.

    free: (N,) all True.
    """
    taken, count = np.empty((most, 2), pairs.dtype), 0
    for pair in order:
        if count == most:
            break
        i, j = pairs[pair, 0], pairs[pair, 1]
        if free[i] and free[j]:
            free[i] = free[j] = False
            taken[count, 0], taken[count, 1] = i, j
            count += 1
    return taken[:count]


@own_kernel(nogil=True, error_model="numpy")
def join_spreads(keep, drop, share, places, rotations, scales, middle, spread):
    """middle (P, 3) m and spread (P, 3, 3) m2, written: of gaussians `keep` and `drop`, (P,) indices, by share (P,) of the first.

    places: (N, 3) m; rotations: (N, 3, 3); scales: (N, 3) m.
    """
    axes, off = np.empty((3, 3)), np.empty(3)
    for p in range(len(keep)):
        for c in range(3):
            middle[p, c] = share[p] * places[keep[p], c] + (1 - share[p]) * places[drop[p], c]
        for part in range(2):
            i, weight = (keep[p], share[p]) if part == 0 else (drop[p], 1 - share[p])
            for a in range(3):
                off[a] = places[i, a] - middle[p, a]
                for b in range(3):
                    axes[a, b] = np.float64(rotations[i, a, b]) * scales[i, b]
            for a in range(3):
                for b in range(3):
                    square = axes[a, 0] * axes[b, 0] + axes[a, 1] * axes[b, 1] + axes[a, 2] * axes[b, 2]
                    part_spread = weight * (square + off[a] * off[b])
                    spread[p, a, b] = part_spread if part == 0 else spread[p, a, b] + part_spread


@own_kernel(nogil=True, error_model="numpy")
def place_joined(face, at, middle, axes, scales, R, T, k, mu, local, log_scale):
    """Writes what was joined, P gaussians: rows `at` (P,) of mu (N, 3) and log_scale (N, 3), and local (P, 3, 3), their axes in the
    frames of their faces.

    face: (N,); middle: (P, 3) m; axes: (P, 3, 3) columns, made right-handed; scales: (P, 3) m; R, T, k: of the faces' frames.
    """
    off = np.empty(3)
    for p in range(len(at)):
        f = face[at[p]]
        a = axes[p]
        if (a[0, 0] * (a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]) - a[0, 1] * (a[1, 0] * a[2, 2] - a[1, 2] * a[2, 0])
                + a[0, 2] * (a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0])) < 0:
            for c in range(3):
                a[c, 0] = -a[c, 0]
        size = np.float64(max(k[f], np.float32(1e-9)))
        for c in range(3):
            off[c] = middle[p, c] - T[f, c]
        for c in range(3):
            mu[at[p], c] = (R[f, 0, c] * off[0] + R[f, 1, c] * off[1] + R[f, 2, c] * off[2]) / size
            log_scale[at[p], c] = np.log(scales[p, c] / size)
            for d in range(3):
                local[p, c, d] = R[f, 0, c] * a[0, d] + R[f, 1, c] * a[1, d] + R[f, 2, c] * a[2, d]
