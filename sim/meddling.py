"""Outside events in physics: somebody moves the objects, and what follows is contact and gravity."""

from __future__ import annotations

from pydrake.math import RigidTransform, RollPitchYaw

from cognitive_arch.execution.placing import Place, footprint, nearest_free
from cognitive_arch.outside import Happening, OutsideEvent
from sim.robot import Robot
from sim.skills.base import release

DROP = 0.004  # m above the table at which a toppled thing is let go
SETTLE = 0.5  # s until what was disturbed lies still


def disturb(robot: Robot, event: OutsideEvent) -> tuple[str, ...]:
    """See `Environment.disturb`."""
    changed = _touched(robot, event)
    if not changed:
        return ()
    if event.kind is Happening.EMPTY:
        release(robot, event.name, robot.grips[event.name].opening)
        robot.go_home(event.name)
    elif event.kind is Happening.REMOVE:
        robot.world.park(event.name)
    elif event.kind is Happening.TOPPLE:
        x, y, _ = robot.world.pose(changed[0]).translation()
        for n, name in enumerate(changed):
            _lay(robot, name, (float(x), float(y)), DROP, ignoring=changed[n:])
    else:
        assert event.position is not None
        _lay(robot, event.name, event.position, 0.0)
    robot.world.hold(SETTLE)
    return changed


def _touched(robot: Robot, event: OutsideEvent) -> tuple[str, ...]:
    """The objects that an event changes, from the bottom up."""
    name = event.name
    if event.kind is Happening.EMPTY:
        held = robot.truth.held(name) if name in robot.grips else None
        return (held,) if held else ()
    there = set(robot.truth.names())
    if event.kind is Happening.ADD:
        return (name,) if name in set(robot.world.scenario.objects) - there else ()
    if name not in there:
        return ()
    if event.kind is not Happening.TOPPLE:
        return (name,)
    above = _above(robot, name)
    return (name, *above) if robot.truth.supports(name) else above


def _above(robot: Robot, name: str) -> tuple[str, ...]:
    """What lies on `name`, and on that, from the bottom up."""
    found: list[str] = []
    queue = [name]
    while queue:
        new = [other for other in robot.truth.covered_by(queue.pop(0)) if other not in found]
        found += new
        queue += new
    return tuple(sorted(found, key=lambda other: float(robot.truth.pose(other).translation()[2])))


def _lay(robot: Robot, name: str, wanted: Place, above: float, ignoring: tuple[str, ...] = ()) -> None:
    """Put an object flat on the free place of the table nearest to `wanted`, `above` metres over it."""
    world = robot.world
    shape = robot.domain.objects[name].shape
    held = {robot.truth.held(hand) for hand in robot.grips}
    lying = [other for other in robot.truth.names() if other not in {name, *ignoring, *held}]
    others = [
        (robot.truth.place(other)[0] + x, robot.truth.place(other)[1] + y)
        for other in lying
        for x, y in footprint(robot.domain.objects[other].shape, robot.truth.place(other)[2])
    ]
    yaw = float(world.pose(name).rotation().ToRollPitchYaw().yaw_angle())
    x, y = nearest_free(wanted, others, footprint(shape, yaw))
    z = world.scene.table.height + world.height(name) / 2 + 0.0005 + above
    world.place(name, RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, z]))
