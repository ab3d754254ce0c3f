"""What the robot knows from its eyes and its hands: images in, believed poses out (thesis Sec. 6.4.4).

Nothing here reads poses or contacts of things from the simulator. The eyes render what a camera would see;
joints are measured, pads tell by how far they stay open whether something is between them, and the skin of a
hand tells that it touches something, but not what.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from cognitive_arch.domain import ReachLimits
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.overlay import draw
from cognitive_arch.perception.pose import outline_distance
from cognitive_arch.perception.scene import Classify, SceneView, Sighting, sightings
from cognitive_arch.perception.strangers import Stranger, Strangers
from cognitive_arch.perception.top_view import top_view, vectors
from cognitive_arch.shapes import Shape
from cognitive_arch.world.observation import HANDS
from cognitive_arch.world.tracking import Candidate, Detection, HandSense, Place, Pose, Tracker
from sim.eyes import EyeImage, Eyes
from sim.hands import SIDES, hand_links
from sim.kinematics import Kinematics
from sim.perception import Perception
from sim.rendering import Pixels
from sim.world import World

PRESSED = 0.001  # m that a pad stays short of its command when something is in its way
THINNEST = 0.004  # m between pads that hold something
NEARER, FARTHER = 0.006, 0.010  # m; what is that much nearer than a thing hides it, farther is seen past it
PART = 0.4  # of a thing's height, the same for thin ones
HIDDEN = 0.6  # of a thing, above which its place cannot be judged
SAMPLES = 5  # along each side of a thing


class CameraPerception(Perception):
    """The robot's own view of a world. `classify` names what it sees; `seed` is that of the eyes' noise."""

    def __init__(
        self,
        world: World,
        kinematics: Kinematics,
        limits: ReachLimits | None,
        eyes: Eyes,
        classify: Classify,
        seed: int = 0,
    ) -> None:
        super().__init__(world.domain, kinematics, limits)
        self._world, self._eyes, self._classify = world, eyes, classify
        self._seed = seed
        self._shapes = {name: world.domain.objects[name].shape for name in world.scenario.objects}
        self._table = world.scene.table.height
        self._tracker = Tracker(self._shapes, self._table)
        self._strangers = Strangers(self._table)
        self._looked, self._felt = -1.0, -1.0
        self._descriptors: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {}
        self.image: EyeImage | None = None
        self.sightings: Sequence[Sighting] = ()
        self._names: dict[int, str] = {}  # what sightings are taken to be, by index

    @property
    def time(self) -> float:
        return self._world.time

    # -- looking and feeling --------------------------------------------------------------------------------

    def look(self) -> None:
        """See `Perception.look`."""
        known = self._looked == self._world.time
        if known and self.image is not None:
            return
        self._looked = self._world.time
        # Noise depends on the moment, so that whoever goes on with a run sees what it would have seen.
        rng = np.random.default_rng([self._seed, round(1000 * self._world.time)])
        self.image = self._eyes.look(self._world.positions(), rng)
        image = self.image
        view = SceneView(image.color, image.depth, image.own, image.camera, self._table, self._eyes.noisy)
        image = replace(image, depth=view.depth)
        self.sightings = sightings(view, self._classify, self._shapes)
        detections = [_detection(sighting) for sighting in self.sightings]
        if known:  # what a restored robot saw last is what it sees, and what it made of that is restored
            found = self._tracker.associate(detections)
        else:
            found = self._tracker.update(
                detections, self._senses(), lambda name, pose: _judge(image, self._shapes[name], pose)
            )
        self._name(detections, found)
        if not known:
            self._strangers.update(
                [one.region.surface for n, one in enumerate(self.sightings) if n not in self._names],
                [(self._shapes[name], track.pose) for name, track in self._tracker.tracks.items()],
                lambda shape, pose: _judge(image, shape, pose),
            )

    def _name(self, detections: Sequence[Detection], found: Mapping[str, int]) -> None:
        """Note what sightings are taken to be, and the shapes of what is seen well."""
        glimpsed = {index: one.best[0] for index, one in enumerate(detections) if one.telling}
        self._names = glimpsed | {index: name for name, index in found.items()}
        held = {self._tracker.held(hand) for hand in HANDS}
        for name, index in found.items():
            # In a hand a thing shows another side, and its lower half may not be the handle any more.
            if self.sightings[index].whole and name not in held:
                self._descriptors[name] = _described(self.sightings[index])

    def _senses(self) -> dict[str, HandSense]:
        joints = self._world.joints()
        return {
            hand: HandSense(self._kinematics.hand_pose(hand, joints).GetAsMatrix4(), self._grips(hand))
            for hand in HANDS
        }

    def _grips(self, hand: str) -> bool:
        """Whether the pads stay short of where they are to close to: something is between them."""
        measured = self._world.fingers(self._world.joints(), hand)
        wanted = self._world.fingers(self._world.set_point, hand)
        return bool((measured - wanted > PRESSED).all() and measured.sum() > THINNEST)

    def feel(self) -> None:
        """See `Perception.feel`."""
        self._feel()

    def _feel(self) -> Tracker:
        if self._felt != self._world.time:
            self._felt = self._world.time
            self._tracker.feel(self._senses())
        return self._tracker

    def take_hold(self, hand: str, name: str) -> None:
        """See `Perception.take_hold`."""
        if not self._grips(hand):
            return
        X_WH = self._kinematics.hand_pose(hand, self._world.joints())
        X_HO = X_WH.inverse() @ self.pose(name)
        self._tracker.take_hold(hand, name, X_WH.GetAsMatrix4(), (X_WH @ X_HO).GetAsMatrix4())

    def feels(self, what: str, name: str) -> bool:
        """See `Perception.feels`. A tool has no skin: whether it moved something is for the eyes to tell."""
        if what not in SIDES:
            return True
        links = hand_links(SIDES[what])
        # The skin does not tell one thing from another; robot and table it knows from its joints.
        things = set(self._shapes)
        return any(a in links and b in things for a, b in self._world.contacts())

    def descriptors(self, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return self._descriptors.get(name, ((), ()))

    def strangers(self) -> Mapping[str, Stranger]:
        return self._strangers.named()

    def picture(self) -> Pixels | None:
        """See `Perception.picture`: names of what is seen, and crosses for what is remembered."""
        if self.image is None:
            return None
        tracks = self._tracker.tracks.items()
        hidden = {name: track.pose[:3, 3] for name, track in tracks if not track.visible}
        places = self.image.camera.project(np.array(list(hidden.values())).reshape(-1, 3))
        remembered = {name: (float(x), float(y)) for name, (x, y) in zip(hidden, places, strict=True)}
        return draw(self.image.color, self.sightings, self._names, self.image.own, remembered)

    # -- what is believed -----------------------------------------------------------------------------------

    def names(self) -> tuple[str, ...]:
        return tuple(sorted(self._feel().tracks))

    def visible(self) -> tuple[str, ...]:
        return tuple(sorted(name for name, track in self._feel().tracks.items() if track.visible))

    def absent(self) -> tuple[str, ...]:
        return tuple(sorted(self._feel().gone))

    def pose(self, name: str) -> RigidTransform:
        return RigidTransform(self._feel().tracks[name].pose)

    def held(self, hand: str) -> str | None:
        return self._feel().held(hand)

    def supports(self, name: str) -> tuple[str, ...]:
        return self._feel().supports(name)

    def on_table(self, name: str) -> bool:
        return self._feel().on_table(name)

    def save(self) -> dict[str, Any]:
        return {
            "tracker": self._tracker.to_json(),
            "strangers": self._strangers.to_json(),
            "looked": self._looked,
            "seed": self._seed,
            "descriptors": {
                name: [list(part) for part in parts] for name, parts in self._descriptors.items()
            },
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        self._tracker.restore(saved["tracker"])
        self._strangers.restore(saved["strangers"])
        self._descriptors = {
            str(name): (tuple(map(float, desc)), tuple(map(float, tooldesc)))
            for name, (desc, tooldesc) in saved["descriptors"].items()
        }
        self._seed = int(saved["seed"])
        self._looked, self._felt = float(saved["looked"]), -1.0
        if not math.isfinite(self._looked):
            raise ValueError("the time of the last look is no number")
        if self._seed < 0:
            raise ValueError("the seed of the eyes' noise is negative")


def _detection(sighting: Sighting) -> Detection:
    candidates = {
        name: Candidate(guess.probability, guess.estimate.matrix(), guess.estimate.sigma)
        for name, guess in sighting.hypotheses.items()
    }
    return Detection(candidates, sighting.unknown, sighting.glimpse)


def _described(sighting: Sighting) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return vectors(describe(top_view(sighting.region.mask, sighting.region.surface)))


def _judge(image: EyeImage, shape: Shape, X_WO: Pose) -> Place:
    """What is to be seen where a thing's upper side should be."""
    points = (X_WO[:3, :3] @ _upper_side(shape).T).T + X_WO[:3, 3]
    camera = image.camera
    pixels = np.rint(camera.project(points))
    width, height = camera.size
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
    columns, rows = pixels[inside].astype(int).T
    expected = ((points[inside] - camera.position) @ camera.X_WC[:3, :3])[:, 2]
    seen = image.depth[rows, columns]
    hidden = image.own[rows, columns] | (seen < expected - NEARER)
    past = ~hidden & (seen > expected + min(FARTHER, PART * shape.height))
    if hidden.sum() + (~inside).sum() > HIDDEN * len(points):
        return Place.HIDDEN
    return Place.EMPTY if past.sum() > (~hidden & ~past).sum() else Place.TAKEN


def _upper_side(shape: Shape) -> np.ndarray:
    """Places on it, (n, 3) metres in the thing's frame."""
    across = max(SAMPLES, round(max(shape.extent) / min(shape.extent)) * 2)
    x, y = (np.linspace(-0.5, 0.5, 2 * across + 1)[1::2] * side for side in shape.extent)
    grid = np.array(np.meshgrid(x, y)).reshape(2, -1).T
    inside = grid[outline_distance(shape)(grid) < 0]
    level = 0.0 if shape.rolls else shape.height / 2
    return np.column_stack([inside, np.full(len(inside), level)])
