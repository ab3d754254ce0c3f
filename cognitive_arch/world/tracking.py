"""Tracking: from the detections of one look after another to things that stay the same things.

Data association, persistence and occlusion (thesis Sec. 6.4.4). A thing that is in view is where it was seen;
one in a hand moves with the hand; one that is hidden is where it was last seen, until its place is seen to be
empty or taken by something else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from cognitive_arch.shapes import Shape
from cognitive_arch.world.observation import HANDS

Pose = NDArray[np.float64]  # (4, 4), a thing or a hand in the root frame, m
FAR, FAR_COST = 0.15, 1.0  # m after which distance from where a thing was speaks no further against it
NEW_COST = 0.5  # in log probability, for a thing that was not there before
NEAR, NEAR_COST = 0.06, 7.0  # m within which a thing was seen, and what that speaks against a stranger
CONVINCING = 0.5  # probability from which on a glimpse tells what it shows
LEAST = 1e-6  # probability
SAME = 0.008  # m that a thing at rest may seem to move
DRIFT = 0.002  # m of uncertainty that one look later adds
LOST = 0.08  # m from where the hand would hold it at which a thing was not in the hand
SLIPPED = 0.3  # rad by which eyes believe that it has turned in the hand
EXACT = 0.007  # m of uncertainty up to which eyes tell better than fingers how it is held
LOOSE = 0.05  # m of uncertainty about what has just left a hand
IN_HAND = 0.002  # m, of what is in a hand
TOUCHING = 0.006  # m between an underside and what carries it, as seen
WITHIN = 0.004  # m by which two things cannot overlap in height


@dataclass(frozen=True, slots=True)
class Candidate:
    """What a detection would be as a certain thing: how likely, where, how exact (m)."""

    probability: float
    pose: Pose
    sigma: float


@dataclass(frozen=True, slots=True)
class Detection:
    """Something in view: what it may be, by name, and how likely it is none of these.

    Of a `glimpse` so little is seen that its place is not to be trusted.
    """

    candidates: Mapping[str, Candidate]
    unknown: float = LEAST
    glimpse: bool = False

    @property
    def best(self) -> tuple[str, float]:
        """What it most likely is, and how likely."""
        chances = {name: candidate.probability for name, candidate in self.candidates.items()}
        name = max(chances, key=lambda name: chances[name])
        return name, chances[name]

    @property
    def telling(self) -> bool:
        """Whether it is a glimpse that tells what it shows."""
        return self.glimpse and bool(self.candidates) and self.best[1] > CONVINCING


class Place(Enum):
    """What is to be seen where a thing should be."""

    EMPTY = "empty"  # one sees what is behind it
    HIDDEN = "hidden"  # something is in front of it
    TAKEN = "taken"  # something is there, as it should


@dataclass(frozen=True, slots=True)
class HandSense:
    """A hand by proprioception: its pose, and whether its fingers press on something."""

    pose: Pose
    gripping: bool


@dataclass(frozen=True, slots=True)
class Track:
    """A thing that is believed to be there; `in_hand` is its pose in the frame of the hand that holds it."""

    pose: Pose
    sigma: float
    visible: bool = True
    hand: str | None = None
    in_hand: Pose | None = None


@dataclass
class Tracker:
    """What is where. `shapes` are those of all things that there may be, by name; `table` its height, m."""

    shapes: Mapping[str, Shape]
    table: float
    tracks: dict[str, Track] = field(default_factory=dict)
    gone: set[str] = field(default_factory=set)

    def update(
        self,
        detections: Sequence[Detection],
        hands: Mapping[str, HandSense],
        place: Callable[[str, Pose], Place],
    ) -> dict[str, int]:
        """Fold one look in. `place` tells what is to be seen where a thing should be.

        Returns which detection (its index) each thing in view is taken to be.
        """
        self.feel(hands)
        found = self.associate(detections)
        for name, index in found.items():
            self._see(name, detections[index].candidates[name])
        missing = [name for name in self.tracks if name not in found]
        verdicts = {name: self._missed(name, found, place) for name in missing}
        for name, verdict in verdicts.items():
            if verdict is Place.EMPTY:
                del self.tracks[name]
                self.gone.add(name)
            else:
                self.tracks[name] = replace(self.tracks[name], visible=verdict is Place.TAKEN)
        glimpses = [detection for detection in detections if detection.telling]
        for name in sorted(self.tracks, key=self.bottom):
            self._explain(name, {d.best[0] for d in glimpses}, self.gone & set(missing))
        for detection in glimpses:
            name = detection.best[0]
            if name not in self.tracks:
                self.tracks[name] = Track(detection.candidates[name].pose, LOOSE / 2, visible=False)
        self.gone -= self.tracks.keys()
        return found

    def feel(self, hands: Mapping[str, HandSense]) -> None:
        """Fold proprioception in: what is held moves along, what is not any more is where it was last."""
        for name, track in self.tracks.items():
            if track.hand is None or track.in_hand is None:
                continue
            hand = hands[track.hand]
            if hand.gripping:
                self.tracks[name] = replace(track, pose=hand.pose @ track.in_hand, sigma=IN_HAND)
            else:
                self.tracks[name] = replace(track, hand=None, in_hand=None, sigma=LOOSE)

    def take_hold(self, hand: str, name: str, X_WH: Pose, X_WO: Pose) -> None:
        """The fingers of a hand at `X_WH` close around a thing at `X_WO`."""
        for other, track in self.tracks.items():
            if track.hand == hand:
                self.tracks[other] = replace(track, hand=None, in_hand=None)
        in_hand = np.linalg.inv(X_WH) @ X_WO
        self.tracks[name] = Track(X_WO, IN_HAND, True, hand, in_hand)

    def held(self, hand: str) -> str | None:
        """What is believed to be in a hand."""
        return next((name for name, track in self.tracks.items() if track.hand == hand), None)

    def bottom(self, name: str) -> float:
        """Height of a thing's underside, m."""
        return float(self.tracks[name].pose[2, 3]) - self.shapes[name].height / 2

    def top(self, name: str) -> float:
        """Height of a thing's upper side, m."""
        return float(self.tracks[name].pose[2, 3]) + self.shapes[name].height / 2

    def on_table(self, name: str) -> bool:
        """Whether a thing rests on the table itself."""
        return self.tracks[name].hand is None and self.bottom(name) - self.table < TOUCHING

    def supports(self, name: str) -> tuple[str, ...]:
        """The things that one rests on: below it sideways, their upper side at its underside."""
        if self.tracks[name].hand is not None or self.on_table(name):
            return ()
        below = [(abs(self.bottom(name) - self.top(other)), other) for other in self._below(name)]
        near = [other for gap, other in sorted(below) if gap < TOUCHING]
        return tuple(near or [other for _, other in sorted(below)[:1]])

    def _above(self, upper: str, lower: str) -> bool:
        p, q = self.tracks[upper].pose[:3, 3], self.tracks[lower].pose[:3, 3]
        sideways = math.hypot(p[0] - q[0], p[1] - q[1])
        return bool(p[2] > q[2] + WITHIN and sideways < min(self.shapes[lower].extent) / 2)

    # -- one look -----------------------------------------------------------------------------------------

    def associate(self, detections: Sequence[Detection]) -> dict[str, int]:
        """Which detection (its index) is which thing: the likeliest assignment of all of them together."""
        told = [index for index, detection in enumerate(detections) if not detection.glimpse]
        names = sorted({name for index in told for name in detections[index].candidates})
        if not names:
            return {}
        # One column per thing, then one per detection for its being none of them.
        scores = np.full((len(told), len(names) + len(told)), math.log(LEAST) - 10)
        for row, detection in enumerate(detections[index] for index in told):
            cost = NEAR_COST if self._was_here(detection) else 0.0
            scores[row, len(names) + row] = math.log(max(detection.unknown, LEAST)) - cost
            for name, candidate in detection.candidates.items():
                scores[row, names.index(name)] = self._score(name, candidate)
        rows, columns = linear_sum_assignment(-scores)
        return {
            names[column]: told[row]
            for row, column in zip(rows, columns, strict=True)
            if column < len(names) and names[column] in detections[told[row]].candidates
        }

    def _score(self, name: str, candidate: Candidate) -> float:
        likely = math.log(max(candidate.probability, LEAST))
        track = self.tracks.get(name)
        if track is None:
            return likely - NEW_COST
        moved = float(np.linalg.norm(track.pose[:3, 3] - candidate.pose[:3, 3]))
        return likely - min(moved / FAR, 1.0) * FAR_COST

    def _was_here(self, detection: Detection) -> bool:
        """Whether what a detection looks like most was seen here before: one that has fallen over looks
        little like itself, but it is likelier than a stranger in its place."""
        if not detection.candidates:
            return False
        name, _ = detection.best
        track = self.tracks.get(name)
        if track is None or not track.visible or track.hand is not None:
            return False
        moved = np.linalg.norm(track.pose[:3, 3] - detection.candidates[name].pose[:3, 3])
        return bool(moved < NEAR)

    def _see(self, name: str, seen: Candidate) -> None:
        track = self.tracks.get(name)
        if track is not None and track.hand is not None:
            if np.linalg.norm(track.pose[:3, 3] - seen.pose[:3, 3]) < LOST:
                self.tracks[name] = _held_as_seen(track, seen)
                return
            track = None  # it lies somewhere else: the hand has something else, or nothing
        if track is None:
            self.tracks[name] = Track(seen.pose, seen.sigma)
            return
        apart = float(np.linalg.norm(track.pose[:3, 3] - seen.pose[:3, 3]))
        if apart > max(SAME, 2 * seen.sigma) or apart > 3 * math.hypot(track.sigma, seen.sigma):
            self.tracks[name] = Track(seen.pose, seen.sigma)
            return
        before = track.sigma**2 + DRIFT**2
        weight = before / (before + seen.sigma**2)
        # Of two looks at the same thing at rest the more exact one counts more; the yaw is that one's.
        pose = (seen.pose if seen.sigma <= track.sigma else track.pose).copy()
        pose[:3, 3] = track.pose[:3, 3] + weight * (seen.pose[:3, 3] - track.pose[:3, 3])
        sigma = math.sqrt(before * seen.sigma**2 / (before + seen.sigma**2))
        self.tracks[name] = Track(pose, sigma)

    def _missed(self, name: str, found: Iterable[str], place: Callable[[str, Pose], Place]) -> Place:
        """What became of a thing that is not among those found: it is felt in a hand, still there, hidden, or
        gone, since something else is there now or because it would float."""
        if self.tracks[name].hand is not None:
            return Place.TAKEN
        verdict = place(name, self.tracks[name].pose)
        if any(self._overlap(name, other) for other in found):
            return Place.EMPTY
        if verdict is Place.HIDDEN and not self.on_table(name) and not self._carried(name):
            return Place.EMPTY
        return verdict

    def _carried(self, name: str) -> bool:
        """Whether something is where a thing's underside is."""
        return any(abs(self.bottom(name) - self.top(other)) < LOOSE / 2 for other in self._below(name))

    def _overlap(self, name: str, other: str) -> bool:
        p, q = self.tracks[name].pose[:3, 3], self.tracks[other].pose[:3, 3]
        sideways = math.hypot(p[0] - q[0], p[1] - q[1])
        deep = min(self.top(name), self.top(other)) - max(self.bottom(name), self.bottom(other))
        room = min(*self.shapes[name].extent, *self.shapes[other].extent) / 2
        return bool(deep > WITHIN and sideways < room)

    def _explain(self, name: str, glimpsed: set[str], vanished: set[str]) -> None:
        """What seems to rest on nothing rests on something hidden: of what is missing, what fits between.

        That is what a glimpse shows, or else the only thing of the right height that has just vanished.
        """
        track = self.tracks[name]
        if track.hand is not None or not track.visible or self.on_table(name):
            return
        while True:
            floor = max([self.table, *(self.top(o) for o in self._below(name))])
            gap = self.bottom(name) - floor
            missing = {n for n in self.shapes if n not in self.tracks}
            heights = {n: self.shapes[n].height for n in missing if self.shapes[n].height < gap + TOUCHING}
            shown = [n for n in heights if n in glimpsed]
            fitting = [n for n in vanished & heights.keys() if abs(heights[n] - gap) < TOUCHING / 2]
            if gap < TOUCHING or not (shown or len(fitting) == 1):
                return
            hidden = max(shown, key=lambda n: (-abs(heights[n] - gap), n)) if shown else fitting[0]
            pose = track.pose.copy()
            pose[2, 3] = floor + heights[hidden] / 2
            self.tracks[hidden] = Track(pose, LOOSE / 4, visible=False)

    def _below(self, name: str) -> list[str]:
        """What is lower than a thing, and under its middle."""
        return [
            other
            for other, track in self.tracks.items()
            if other != name and track.hand is None and self._above(name, other)
        ]

    # -- keeping ------------------------------------------------------------------------------------------

    def to_json(self) -> dict[str, Any]:
        """Plain data; `restore` reads it back."""
        rows = {
            name: {
                "pose": track.pose.tolist(),
                "sigma": track.sigma,
                "visible": track.visible,
                "hand": track.hand,
                "in_hand": None if track.in_hand is None else track.in_hand.tolist(),
            }
            for name, track in self.tracks.items()
        }
        return {"tracks": rows, "gone": sorted(self.gone)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """The inverse of `to_json`; raises `ValueError` for things that there are not."""
        names: Iterable[str] = [*saved["tracks"], *saved["gone"]]
        if not set(names) <= set(self.shapes):
            raise ValueError("it speaks of other things")
        rows = saved["tracks"].values()
        if not {row["hand"] for row in rows} <= {None, *HANDS}:
            raise ValueError("it speaks of other hands")
        if any((row["hand"] is None) != (row["in_hand"] is None) for row in rows):
            raise ValueError("a thing is held without a place in the hand, or the other way round")
        for pose in (row[key] for row in rows for key in ("pose", "in_hand") if row[key] is not None):
            check_pose(np.array(pose, float))
        self.tracks = {
            name: Track(
                np.array(row["pose"], float).reshape(4, 4),
                float(row["sigma"]),
                bool(row["visible"]),
                row["hand"],
                None if row["in_hand"] is None else np.array(row["in_hand"], float).reshape(4, 4),
            )
            for name, row in saved["tracks"].items()
        }
        self.gone = set(saved["gone"])


def _held_as_seen(track: Track, seen: Candidate) -> Track:
    """How a thing is held, corrected by how it is seen to be: it may have turned as the fingers closed.

    Eyes tell where it is and how it is turned about the vertical; how level it is the hand knows better.
    """
    turn = _yaw(seen.pose) - _yaw(track.pose)
    turn = (turn + math.pi / 2) % math.pi - math.pi / 2  # many things look the same from behind
    if track.in_hand is None or seen.sigma > EXACT or abs(turn) > SLIPPED:
        return replace(track, visible=True)
    X_WH = track.pose @ np.linalg.inv(track.in_hand)
    pose = track.pose.copy()
    c, s = math.cos(turn), math.sin(turn)
    pose[:2, :3] = np.array(((c, -s), (s, c))) @ track.pose[:2, :3]
    pose[:3, 3] = seen.pose[:3, 3]
    return replace(track, pose=pose, visible=True, in_hand=np.linalg.inv(X_WH) @ pose)


def _yaw(pose: Pose) -> float:
    return math.atan2(pose[1, 0], pose[0, 0])


def check_pose(pose: Pose) -> None:
    """Raise `ValueError` for what is no pose."""
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError("a pose is a matrix of 4 by 4 finite numbers")
    if not np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-6):
        raise ValueError("a pose needs a rotation")
