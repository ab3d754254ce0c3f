"""The skills by the names the rules use: one module each, one row here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cognitive_arch.relational.symbols import GroundAction
from sim.skills.bare_pull import pull_with_hand
from sim.skills.bare_push import push_with_hand
from sim.skills.base import Skill
from sim.skills.drop import drop
from sim.skills.grasp import grasp
from sim.skills.lift import lift
from sim.skills.pull import pull
from sim.skills.push import push
from sim.skills.put import put_on
from sim.skills.tap import tap_from_left, tap_from_right
from sim.skills.touch import touch


@dataclass(frozen=True)
class SkillEntry:
    """A skill; its `forms` by how many objects they take before the hand."""

    forms: Mapping[int, Skill]

    def form_for(self, action: GroundAction) -> Skill | None:
        """The form that takes as many arguments, if there is one."""
        return self.forms.get(len(action.args) - 1)


SKILLS = {
    "graspWith": SkillEntry({1: grasp}),
    "putOnWith": SkillEntry({2: put_on}),
    "dropWith": SkillEntry({1: drop}),
    "pull": SkillEntry({1: pull_with_hand, 2: pull}),  # with the bare hand, with a tool
    "push": SkillEntry({1: push_with_hand, 2: push}),
    "tapFromLeft": SkillEntry({1: tap_from_left}),
    "tapFromRight": SkillEntry({1: tap_from_right}),
    "touch": SkillEntry({1: touch}),
    "lift": SkillEntry({1: lift}),
}
