"""Where the arm ends in a robot's description: the one rule for its flange.

A link that follows a convention is the flange. Else the arm ends behind its last joint, where names
and structure leave no doubt; where they do, a person is asked, and told what each answer means.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import takewhile
from typing import NoReturn

from prior_reinforce.arm.robots.urdf_file import Joint
from prior_reinforce.errors import UnclearFlangeError
from prior_reinforce.wording import listed

MOST_JOINTS = 100
"""Turning joints of one arm (ours)."""
_MOST_NAMED = 40
"""Links in a message (ours)."""
_TIPS = ("tool0", "flange", "link_eef")
"""Links that are the flange by ROS's conventions (REP 199) and UFACTORY's; the first there is."""
_TIP = re.compile(rf"(?:^|[^A-Za-z0-9])({'|'.join(_TIPS)})$")
"""One of these behind any prefix or namespace."""
_FINGER = re.compile("finger|jaw|claw|knuckle|thumb|pinch", re.IGNORECASE)
_GRIPPER = re.compile("grip|tong", re.IGNORECASE)
_OF_AN_ARM = re.compile("wrist|elbow|shoulder|roll|pitch|yaw|rotat", re.IGNORECASE)
_ALONE = re.compile(r"[^\W\d_](?![^\W\d_])")
"""A letter that is no part of a word."""
_SHORTEST_ARM = 3
"""Joints of an arm beside another (ours), since a head has 2 and a wheel 1, and of one whose names
tell of a tool's among them."""


def joints_to(link: str, moving: Mapping[str, Joint], base: str | None = None) -> list[Joint]:
    """Return the joints from the base, or the root, to a link."""
    found = list[Joint]()
    while link in moving and link != base:
        found.append(moving[link])
        link = found[-1].parent
    return found[::-1]


def arms_own(names: Sequence[str]) -> int:
    """Return how many joints of a chain are the arm's by their names, from its base on.

    The last of them is called as parts of arms are, or as one before it but for its number.
    Where that is said of none, the last joint alone is in doubt.
    """
    n = len(names)
    if n < _SHORTEST_ARM:
        return n
    while n > 1:
        block = 1
        while block < n and _alike(names[n - 1 - block], names[n - 1]):
            block += 1
        before = names[: n - block]
        # joint_1 to joint_6, then servo_1 and servo_2: another device's.
        anew = len(before) > max(block, 2) and all(_alike(before[0], name) for name in before[1:])
        if _OF_AN_ARM.search(names[n - 1]) or (block > 1 and not anew):
            return n
        n -= block
    return len(names) - 1


@dataclass(frozen=True)
class _Arm:
    """One way from the base outwards, and how far it is an arm's without doubt."""

    way: Sequence[str]
    """The bodies from the base, without it."""
    own: int
    """How many of them are the arm's without doubt."""
    doubtful: Joint | None
    """The joint behind these that may be the arm's as well, or a tool's."""

    @property
    def end(self) -> str:
        return self.way[self.own - 1]

    def has_rival(self, other: _Arm, named: bool) -> bool:
        """Whether another is an arm as well, of similar size; fewer are where this one is named."""
        shared = len({*self.way[: self.own]} & {*other.way[: other.own]})
        rest, own = self.own - shared, other.own - shared
        if not rest or 2 * own <= rest or own > MOST_JOINTS:
            return False
        return own >= _SHORTEST_ARM or (own >= rest and not named)


class Tree:
    """What a description's joints move behind a base: the one arm there, and what it carries."""

    def __init__(
        self,
        links: Sequence[str],
        moving: Mapping[str, Joint],
        base: str,
        still: Collection[str],
        meshes: Mapping[str, str],
    ) -> None:
        """Sort the links by the joints that carry them.

        Args:
            links: From the root outwards.
            moving: The joint that moves each link.
            base: Where the arm begins.
            still: Joints that stand still.
            meshes: File names of each link's meshes: of a CAD program's export often all that
                tells.
        """
        self.moving = moving
        self.rigid = {base: base}
        """By link, the innermost one against which it stands still."""
        self.body = {base: base}
        """By link, the one that the turning joint before it moves; without a gripper's."""
        self.depth = {base: 0}
        """How many joints turn up to such a body."""
        self.others = defaultdict[str, list[Joint]](list)
        """What slides or follows, by the body that carries it."""
        self.gripper = defaultdict[str, list[Joint]](list)
        """Joints that are a gripper's by name, likewise."""
        self.followers = defaultdict[str, list[Joint]](list)
        """What follows a joint, by its name."""
        carrying = {joint.parent for joint in moving.values()}
        for link in links:
            joint = moving.get(link)
            if link == base or joint is None or joint.parent not in self.rigid:
                continue
            stands = joint.type == "fixed" or joint.name in still
            self.rigid[link] = self.rigid[joint.parent] if stands else link
            before = self.body.get(joint.parent)
            # A hand is called by its fingers, too: a mesh tells of what carries nothing else.
            mesh = "" if link in carrying else meshes.get(link, "")
            if before is None:
                continue  # behind a gripper's joint
            if stands:
                self.body[link] = before
            elif _of_a_gripper(joint, mesh):
                self.gripper[before].append(joint)
            elif joint.free:
                self.body[link], self.depth[link] = link, self.depth[before] + 1
            else:
                self.body[link] = before
                self.others[before].append(joint)
        self.tips = dict[str, str]()
        """By body, the link on it that is the flange by convention."""
        for link, body in self.body.items():
            if self.depth[body] and _rank(link) < _rank(self.tips.get(body, "")):
                self.tips[body] = link
        for joint in moving.values():
            self.followers[joint.mimics or ""].append(joint)

    def flange(self) -> str:
        """Return the link that is the flange of the one arm: the rule of this module.

        Raises:
            UnclearFlangeError: There are several arms, or a joint may be the arm's or a tool's.
        """
        ends = self._ends()
        named = [body for body in ends if body in self.tips]
        if len(named) > 1 or not ends:
            self._several([self.tips[body] for body in named])
        arms = dict[str, _Arm]()
        for end in ends:
            way = self._way(end)
            found = _Arm(way, len(way), None) if end in named else self._arm(way)
            arms.setdefault(found.end, found)
        arm = arms[named[0]] if named else max(arms.values(), key=lambda each: each.own)
        rivals = [other for other in arms.values() if arm.has_rival(other, bool(named))]
        if rivals:
            self._several([self._said(each) for each in (arm, *rivals)])
        if arm.doubtful is not None:
            self._ask(arm, arm.doubtful)
        return self.tips.get(arm.end, arm.end)

    def said_behind(self, body: str) -> str:
        """Say what is fixed to the arm's last moving link, if no convention's, and moves behind."""
        fixed = [] if body in self.tips else self._fixed_to(body)
        inside, moved = {body}, list[str]()
        for link, rigid in self.rigid.items():
            if link in self.moving and self.moving[link].parent in inside:
                inside.add(link)
                if rigid == link and self.moving[link].mimics is None:
                    moved.append(self.moving[link].name)
        said = f"; fixed behind it: {listed(fixed)} (--tip NAME takes one)" * bool(fixed)
        return said + f"; moved behind it: {listed(moved, most=3)}" * bool(moved)

    def _fixed_to(self, body: str) -> list[str]:
        """Links that stand still against the one that a joint moves, from it outwards."""
        return [link for link, rigid in self.rigid.items() if rigid == body != link]

    def _ends(self) -> list[str]:
        """Bodies in which arms may end: none turns behind them, or what does is a tool."""
        bodies = [*self.depth][1:]
        carrying = {self._before(body) for body in bodies}
        # Links within an arm are called so, too.
        ended = self.tips.keys() - {self._before(body) for body in bodies if self._goes_on(body)}
        behind = set[str]()
        for body in bodies:
            if self._before(body) in ended | behind:
                behind.add(body)
        return [b for b in bodies if b not in behind and (b in ended or b not in carrying)]

    def _goes_on(self, body: str) -> bool:
        """Whether the joint before a body is behind a convention's link, and may be the arm's."""
        if self._before(body) not in self.tips:
            return False
        *names, last = [self.moving[each].name for each in self._way(body)]
        return not arms_own(names) == len(names) == arms_own([*names, last])

    def _before(self, body: str) -> str:
        return self.body[self.moving[body].parent]

    def _way(self, body: str) -> list[str]:
        """The bodies from the base, without it, to one."""
        found = list[str]()
        while self.depth[body]:
            found.append(body)
            body = self._before(body)
        return found[::-1]

    def _several(self, ends: Sequence[str]) -> NoReturn:
        raise UnclearFlangeError(
            f"it ends in {listed(ends, most=_MOST_NAMED) or 'no turning joint'}; say which link is "
            "the flange with --tip"
        )

    def _said(self, arm: _Arm) -> str:
        """An arm's end, and the other where there is a doubt."""
        tip, joint = self.tips.get(arm.end, arm.end), arm.doubtful
        if joint is None or joint in self.gripper[arm.end]:
            return tip
        return f"{tip} (or {self._else(arm.way, joint)})"

    def _arm(self, way: Sequence[str]) -> _Arm:
        """Which of the joints on a way are the arm's without doubt."""
        own, n, last = [self.moving[body] for body in way], len(way), way[-1]
        names = [joint.name for joint in own]
        branch = self._branch(way)
        if branch < n:  # fingers share most of their joints, arms few
            n = arms_own(names[:branch])
            return _Arm(way, n, own[n])
        for joint in self.gripper[last]:
            if joint.free:
                return _Arm(way, n, joint)
        for i, body in enumerate(way[:-1], 1):
            if body in self.tips:
                return _Arm(way, i, own[i])
        if (sure := arms_own(names)) < n:
            return _Arm(way, sure, own[sure])
        for follower in self.followers[names[-1]]:  # two fingers, beside each other
            if n > 1 and self.body.get(follower.parent) == way[-2]:
                return _Arm(way, n - 1, own[-1])
        slides = [self.rigid[j.parent] for j in self.others[last] if j.type == "prismatic"]
        for joint in self.others[last]:
            # What follows a tool's joint is the tool's, and two that slide side by side grip.
            tools = joint.mimics is not None and joint.mimics not in names
            grips = joint.type == "prismatic" and slides.count(self.rigid[joint.parent]) > 1
            if not (tools or grips):
                return _Arm(way, n, joint)
        return _Arm(way, n, None)

    def _branch(self, way: Sequence[str]) -> int:
        """How many joints are before a hand's fingers; all where there is none."""
        for n in range((len(way) + 1) // 2, len(way)):
            beside = [size for size, body in self._sizes[way[n - 1]] if body != way[n]]
            if beside and 2 * max(beside) > len(way) - n:
                return n
        return len(way)

    @cached_property
    def _sizes(self) -> dict[str, list[tuple[int, str]]]:
        """By body, of the two longest chains behind it how many joints turn, and the first body."""
        found = {body: list[tuple[int, str]]() for body in self.depth}
        for body in [*self.depth][:0:-1]:
            size = 1 + max((size for size, _ in found[body]), default=0)
            before = found[self._before(body)]
            before[:] = sorted([*before, (size, body)])[-2:]
        return found

    def _ask(self, arm: _Arm, joint: Joint) -> NoReturn:
        """Ask whether the arm ends before the joint in doubt."""
        last, proposed = self.moving[arm.end].name, self.tips.get(arm.end, arm.end)
        fixed = [link for link in self._fixed_to(arm.end) if link != proposed]
        also = f", or one that is fixed to it: {listed(fixed, most=_MOST_NAMED)}" * bool(fixed)
        doubt = "may be a tool's"
        if joint in self.gripper[arm.way[-1]]:
            doubt = "looks like a gripper's"
        elif joint.mimics is not None:
            doubt = f"follows {joint.mimics}, and {doubt}"
        raise UnclearFlangeError(
            f"joint {joint.name} {doubt}; say which link is the flange with --tip: {proposed}, "
            f"which the arm's last joint {last} moves{also}; or {self._else(arm.way, joint)}",
            proposed,
        )

    def _else(self, way: Sequence[str], joint: Joint) -> str:
        """What to say where a joint in doubt is the arm's."""
        if joint.free:
            return f"{way[-1] if joint.child in way else joint.child}, if {joint.name} is the arm's"
        none = "--robot none, if it is the arm's: no limits are then checked"
        if joint.mimics is not None:
            return none
        at = f"--hold {joint.name}={joint.nearest(0.0):.4g}"
        return f"--tip {joint.child} {at}, if it is the arm's and stands still; or {none}"


def _rank(link: str) -> int:
    """Which of the conventions a link follows; their number where it follows none."""
    found = _TIP.search(link)
    return len(_TIPS) if found is None else _TIPS.index(found[1])


def _of_a_gripper(joint: Joint, mesh: str) -> bool:
    """Whether names say plainly that a joint opens a gripper, and does not turn one."""
    looks = _FINGER.search(f"{joint.child} {mesh}") or _GRIPPER.search(joint.name)
    turns = _OF_AN_ARM.search(joint.name)
    return _FINGER.search(joint.name) is not None or (looks is not None and turns is None)


def _alike(name: str, other: str) -> bool:
    """Whether two names are the same up to a number, or a letter alone: joint_5 and joint_6_t."""
    name, other = name.casefold(), other.casefold()
    pairs = takewhile(lambda pair: pair[0] == pair[1], zip(name, other, strict=False))
    same = "".join(letter for letter, _ in pairs).rstrip("0123456789")
    ends = name[len(same) :], other[len(same) :]
    if same[-1:].isalpha():
        return all(end[:1].isdigit() for end in ends)
    return all(end[:1].isdigit() or _ALONE.match(end) for end in ends)
