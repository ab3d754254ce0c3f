"""Taking a tool at another place of its handle: what is near is swept with a short grip, what is far with a
long one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from cognitive_arch.execution.environment import FailureReason
from sim.robot import Robot
from sim.skills.bare import judge
from sim.skills.base import looked_for
from sim.skills.grasp import take
from sim.skills.put import set_down
from sim.skills.tool import HeldTool, Motion, Sweep, first_feasible, held_tool, lay_targets, perform, unusable

INSETS = (0.03, 0.08, 0.12)  # m from the end of the handle
SAME = 0.02  # m; another grip is not worth while that near to the present one

Sweeps = Callable[[Robot, HeldTool, str], Iterator[Sweep]]


def sweep_with_tool(
    robot: Robot, args: tuple[str, ...], verb: str, sweeps: Sweeps, *, with_bar: bool = False
) -> FailureReason:
    """Move an object with the tool in the hand: the first of the sweeps that the arm can do, if need be with
    another grip; `verb` is the capability whose noise applies."""
    obj, name, hand = args
    reason = unusable(robot, obj, name, hand)
    if reason is not None:
        return reason
    if not looked_for(robot, obj):  # a tool may have turned in the hand, too
        return FailureReason.UNKNOWN_OBJECT
    tool = held_tool(robot, name, hand)
    if with_bar and (tool is None or tool.shape.bar <= 0):
        return FailureReason.CANNOT_PULL
    if tool is None:
        return FailureReason.NOT_A_TOOL
    error = robot.noise.head(verb)  # the robot believes the head to be that far off

    def plan(tool: HeldTool) -> Motion | None:
        believed = tool.with_head_off(error)
        return first_feasible(robot, believed, obj, sweeps(robot, believed, obj))

    motion = plan(tool)
    if motion is None and next(iter(sweeps(robot, tool, obj)), None) is None:
        return FailureReason.BLOCKED
    if motion is None:
        reason = _regrip(robot, tool, plan)
        if reason is not FailureReason.NONE:
            return reason
        regripped = held_tool(robot, tool.name, tool.hand)
        motion = plan(regripped) if regripped is not None else None
    if motion is None:
        return FailureReason.OUT_OF_REACH
    before = robot.perception.pose(obj).translation()
    reason, touched = perform(robot, tool, obj, motion)
    return reason if reason is not FailureReason.NONE else judge(robot, obj, before, motion.course, touched)


def _regrip(robot: Robot, tool: HeldTool, plan: Callable[[HeldTool], Motion | None]) -> FailureReason:
    """Lay the tool down and take it where something can be done with it."""
    for inset in INSETS:
        other = tool.held_at(inset)
        if abs(other.grip - tool.grip) >= SAME and plan(other) is not None:
            reason = set_down(robot, tool.hand, lay_targets(robot, tool, inset))
            robot.perception.look()
            if reason is FailureReason.NONE:
                reason = take(robot, tool.name, tool.hand, (inset,))
                robot.perception.look()
            return reason
    return FailureReason.OUT_OF_REACH
