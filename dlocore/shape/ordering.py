"""Order the points of a cable that a vision system gives as an unordered cloud, and drop those that don't belong to it.

The cloud is thinned to a backbone: the means of balls of one radius, joined by a minimum spanning tree whose longest
path is the cable. The radius grows from the spacing of the points until the tree is hardly more than that path, i.e.
until the balls are wider than the noise. Every point is then ordered by its place along the backbone.

Limits: the cable must not cross itself, nor come closer to itself than about three times the noise or spacing of its
points. A gap in view may be as wide as that, too. Points that can't be ordered are refused, not guessed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist, squareform

from dlocore.errors import SceneError

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_BALLS = 600  # of the backbone: more show no more detail, and the cost of the tree grows with their square
GROWTH = 1.4  # factor on the radius from one try to the next
WIDEST = 0.06  # of the size of the cloud: with wider balls any shape is a short path
A_PATH = 0.97  # the tree counts as a path if this share of the points is on or beside its longest path
LEAST_PATH = 0.85  # if the share is smaller at every radius, the points do not show a single curve
BESIDE = 2.5  # radii from the path within which a ball is beside it, not on a branch
WIDE_GAP = 8.0  # times the typical step: a longer edge of the tree leads to another object
LONELY = 7.0  # times the typical distance to the neighbours: a point farther off is not part of a curve
DEVIATIONS = 5.0  # standard deviations of the noise beyond which a point is an outlier
SPIKE = 2.0  # detour over a point, relative to the way without it, that no cable takes in one step


@dataclass(frozen=True, eq=False)
class Order:
    """The points of a cable in order.

    Attributes:
        order: indices of the points along the cable (m,).
        outliers: indices of the points that do not belong to it, rising.
    """

    order: Indices
    outliers: Indices


def order_points(points: Floats, start: Floats | None = None) -> Order:
    """Order a cloud of points (n, 3) [m] along the cable that they show.

    Args:
        points: in any order, noisy, with outliers.
        start: a point near the cable's end at u = 0 [m]; None: the end with the smaller x (then y, then z).

    Raises:
        SceneError: they don't lie along one open curve.
    """
    inside = _in_company(points)
    path = _backbone(points[inside])
    at, distance = _project(points[inside], path)
    near = distance <= cutoff(distance, floor=0.25 * float(np.median(_steps(path))))
    order = inside[near][np.argsort(at[near], kind="stable")]
    first, last = points[order[0]], points[order[-1]]
    if tuple(last) < tuple(first) if start is None else ((last - start) ** 2).sum() < ((first - start) ** 2).sum():
        order = order[::-1]
    return Order(order=order, outliers=np.setdiff1d(np.arange(len(points)), order))


def without_spikes(points: Floats) -> Order:
    """Drop the outliers among ordered points (n, 3) [m]: points far off the line between their neighbours.

    They are dropped one at a time, the farthest first, since a bad one makes its neighbours look bad, too.
    """
    kept = np.arange(len(points))
    while len(kept) > 4:
        off, detour = _off_line(points[kept])
        bad = (off > cutoff(off, floor=0.0)) & (detour > SPIKE) & (off > 2 * np.median(_steps(points[kept])))
        if not bad.any():
            break
        kept = np.delete(kept, np.argmax(np.where(bad, off, 0.0)))
    return Order(order=kept, outliers=np.setdiff1d(np.arange(len(points)), kept))


def _off_line(p: Floats) -> tuple[Floats, Floats]:
    """Return the distance of each point from the chord of its neighbours [m], and the way over it over that chord."""
    steps = _steps(p)
    chord = np.sqrt(((p[2:] - p[:-2]) ** 2).sum(axis=1))
    along = np.clip(steps[:-1] / np.maximum(steps[:-1] + steps[1:], 1e-300), 0.0, 1.0)
    off = np.sqrt(((p[1:-1] - p[:-2] - along[:, None] * (p[2:] - p[:-2])) ** 2).sum(axis=1))
    detour = (steps[:-1] + steps[1:]) / np.maximum(chord, 1e-300)
    typical = np.median(steps)
    ends = np.where(steps[[0, -1]] > WIDE_GAP * typical, steps[[0, -1]], 0.0)  # nothing lies beyond an end
    return np.concatenate([ends[:1], off, ends[1:]]), np.concatenate([[np.inf], detour, [np.inf]])


def _steps(p: Floats) -> Floats:
    return np.sqrt((np.diff(p, axis=0) ** 2).sum(axis=1))


def cutoff(distance: Floats, floor: float) -> float:
    """Return the distance beyond which a point is an outlier [m]; the median of the half-normal is 0.67 sigma."""
    return max(DEVIATIONS * float(np.median(distance)) / 0.6745, floor)


def _in_company(points: Floats) -> Indices:
    """Return the indices of the points that are not far from all others (m,)."""
    if len(points) < 6:
        return np.arange(len(points))
    distance = np.asarray(cKDTree(points).query(points, k=3)[0])[:, 1:].mean(axis=1)
    return np.flatnonzero(distance <= LONELY * np.median(distance) + 1e-12)


def _backbone(points: Floats) -> Floats:
    """Return a polyline (m, 3) [m] along the middle of the points.

    Raises:
        SceneError: their tree is not a path at any radius, or they are all in one place.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not size > 0:
        raise _no_curve("they are all in one place")
    nearest = np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1]
    radius = max(1.01 * float(np.median(nearest)), size / MAX_BALLS)
    largest = max(radius, WIDEST * size)
    best, most = points[:0], 0.0
    while radius <= largest:
        centres, count = _balls(points, radius)
        if 3 <= len(centres) <= MAX_BALLS:
            path, covered = _longest_path(centres, count, radius)
            if covered > most:
                best, most = centres[path], covered
            if covered >= A_PATH:
                break
        radius *= GROWTH
    if most < LEAST_PATH:
        raise _no_curve("they branch, cross or lie in several parts")
    return best


def _no_curve(why: str) -> SceneError:
    allowed = "points along one open curve that keeps clear of itself; or give them in order"
    return SceneError("points", "points in no order", allowed, f"They show no single curve: {why}")


def _balls(points: Floats, radius: float) -> tuple[Floats, Floats]:
    """Cover the points by balls, and return the means of the points in each (m, 3) and their numbers (m,)."""
    tree = cKDTree(points)
    free = np.ones(len(points), dtype=bool)
    centres: list[Floats] = []
    count: list[int] = []
    for i in range(len(points)):
        if not free[i]:
            continue
        members = np.array(tree.query_ball_point(points[i], radius), dtype=np.intp)
        members = members[free[members]]
        free[members] = False
        centres.append(points[members].mean(axis=0))
        count.append(len(members))
        if len(centres) > MAX_BALLS:
            break
    return np.array(centres), np.array(count, dtype=float)


def _longest_path(centres: Floats, count: Floats, radius: float) -> tuple[Indices, float]:
    """Return the longest path of the tree that joins the centres, and the share of points on or beside it."""
    distance = squareform(pdist(centres))
    tree = csr_matrix(minimum_spanning_tree(distance + 1e-12 * (distance.max() + 1.0)))
    tree.data[tree.data > WIDE_GAP * max(float(np.median(tree.data)), radius)] = 0.0
    tree.eliminate_zeros()
    heaviest = _component_of_most(tree, count)
    path = _path_to_farthest(tree, _path_to_farthest(tree, heaviest)[-1])
    beside = cKDTree(centres[path]).query(centres)[0] <= BESIDE * radius
    return path, float(count[beside].sum() / count.sum())


def _component_of_most(tree: csr_matrix, count: Floats) -> int:
    """Return a node of the part of the forest that contains most points."""
    unseen, best, most = set(range(len(count))), 0, -1.0
    while unseen:
        node = next(iter(unseen))
        part = breadth_first_order(tree, node, directed=False, return_predecessors=False)
        unseen.difference_update(part.tolist())
        if count[part].sum() > most:
            best, most = node, float(count[part].sum())
    return best


def _path_to_farthest(tree: csr_matrix, node: int) -> Indices:
    """Return the path from a node to the one farthest from it along the tree."""
    weights = tree + tree.T
    order, before = breadth_first_order(weights, node, directed=False)
    along = np.full(weights.shape[0], -1.0)
    along[node] = 0.0
    for i in order[1:]:
        along[i] = along[before[i]] + weights[before[i], i]
    path = [int(np.argmax(along))]
    while path[-1] != node:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.intp)


def _project(points: Floats, path: Floats) -> tuple[Floats, Floats]:
    """Return the place of each point along a polyline and its distance from it [m]; the ends are extended straight."""
    start, step = path[:-1], np.diff(path, axis=0)
    length = np.maximum(_steps(path), 1e-300)
    along = np.concatenate([[0.0], np.cumsum(length)])[:-1]
    tree = cKDTree(0.5 * (path[:-1] + path[1:]))
    near = np.atleast_2d(tree.query(points, k=min(4, len(step)))[1].reshape(len(points), -1))
    low = np.where(near == 0, -np.inf, 0.0)
    high = np.where(near == len(step) - 1, np.inf, 1.0)
    share = np.clip(((points[:, None] - start[near]) * step[near]).sum(axis=2) / length[near] ** 2, low, high)
    offset = points[:, None] - start[near] - share[..., None] * step[near]
    distance = np.sqrt((offset**2).sum(axis=2))
    best = np.argmin(distance, axis=1)
    row = np.arange(len(points))
    return (along[near] + share * length[near])[row, best], distance[row, best]
