# SPDX-License-Identifier: BSD-3-Clause
"""Moves all models with scripts of a world together, in one pass over arrays."""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Optional

import numpy as np

from m2wr_sim.control import track_kernels as kernels
from m2wr_sim.errors import PluginError
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.physics.moved_links import MovedLink
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import first_step

if TYPE_CHECKING:
    from m2wr_sim.control.pose_track import PoseScript

PERIOD_NS = 33333333            # Gazebo moves actors 30 times a second of simulated time


class Member:
    """A model that moves along a script.

    Parameters
    ----------
    script : PoseScript
    ctx : PluginContext
        Of the plugin that plays the script.
    """

    def __init__(self, script: PoseScript, ctx: PluginContext) -> None:
        self.ctx, self.tables = ctx, script.tables()
        self.links = ctx.link_places()
        self.state = np.zeros(kernels.SCRIPT_COLUMNS, np.int64)         # its row of ``scripts``, see track_kernels
        self.state[kernels.S_COUNT], self.state[kernels.S_LOOPS] = len(self.tables.tracks), script.loop
        self.state[kernels.S_DELAY_NS] = int(script.delay * 1e9)
        self.begin(ctx.now_ns)

    def begin(self, now_ns: int) -> None:
        """Let the script begin at a time [ns]."""
        self.state[kernels.S_BEGIN_NS] = self.state[kernels.S_DUE_NS] = now_ns
        self.state[kernels.S_ENDED] = 0

    def reject(self, _: object) -> None:
        """Raise PluginError: the script leads to a pose or velocity that is not finite."""
        raise PluginError("the script of %s leads to a pose or velocity that is not finite" % self.ctx.model_name)


class ScriptedModels(Plugin):
    """All models that move along scripts; plugins join it with :meth:`PluginContext.shared`.

    All of them move in the same steps, so that the engine is not interrupted more often for many of them. Between two
    updates each moves at constant velocity, which a contact can feel.
    """

    def __init__(self) -> None:
        self._members: List[Member] = []
        self._stale, self._due_ns = False, kernels.NEVER_NS

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        pass                    # the members have the tags

    def join(self, script: PoseScript, ctx: PluginContext) -> Member:
        """Let the model of a plugin move along a script from now on.

        Parameters
        ----------
        script : PoseScript
        ctx : PluginContext
            Of the plugin.

        Returns
        -------
        Member
            For :meth:`leave` and :meth:`restart`.
        """
        member = Member(script, ctx)
        self._members.append(member)
        self._stale = True
        return member

    def leave(self, member: Member) -> None:
        """Let a model stay where it is; its links may be removed afterwards."""
        if member in self._members:
            self._members.remove(member)
            self._stale = True

    def restart(self, member: Member, now_ns: int) -> None:
        """Let the script of a model begin again.

        Parameters
        ----------
        member : Member
        now_ns : int
            Simulated time [ns].
        """
        member.begin(now_ns)
        self._due_ns = min(self._due_ns, now_ns)

    def next_before(self, now_ns: int) -> Optional[int]:
        if self._stale:
            self._fill()
        if self._due_ns == kernels.NEVER_NS:
            return NEVER
        return max(self._due_ns, now_ns + self._members[0].ctx.step_ns)

    def before_step(self, now_ns: int) -> None:
        if self._stale:
            self._fill()
        step_ns = self._members[0].ctx.step_ns if self._members else 1
        next_ns = first_step((now_ns // PERIOD_NS + 1) * PERIOD_NS, now_ns, step_ns)
        self._due_ns, invalid = kernels.advance(self._scripts, self._spans, self._tracks, self._points, now_ns, step_ns,
                                                next_ns, FASTEST, self._motions, self._effects)
        self._move()
        for row in np.flatnonzero(self._effects == kernels.INVALID).tolist() if invalid else ():
            self._members[row].ctx.hand_over(self._members[row].reject, None)

    def _fill(self) -> None:
        """Put the scripts of all members into arrays."""
        members, points, tracks = self._members, 0, 0
        parts: List[MovedLink] = []
        self._scripts = np.zeros((len(members), kernels.SCRIPT_COLUMNS), np.int64)
        all_tracks = [np.zeros((0, kernels.TRACK_COLUMNS))]
        for row, member in enumerate(members):
            self._scripts[row] = member.state
            member.state = self._scripts[row]           # a view
            member.state[kernels.S_FIRST] = tracks
            all_tracks.append(member.tables.tracks.copy())
            all_tracks[-1][:, kernels.T_FIRST] += points
            points, tracks = points + len(member.tables.points), tracks + len(member.tables.tracks)
            parts += [MovedLink(row, *link) for link in member.links]
        self._tracks = np.concatenate(all_tracks)
        self._points = np.concatenate([np.zeros((0, kernels.POINT_COLUMNS))] + [each.tables.points for each in members])
        self._spans = np.array([each.tables.span for each in members], np.float64).reshape(-1, kernels.SPAN_COLUMNS)
        self._motions = np.zeros((len(members), kernels.MOTION_COLUMNS))
        self._effects = np.zeros(len(members), np.int64)
        self._move = members[0].ctx.physics.link_mover(parts, self._motions, self._effects) if members else _stay
        live = self._scripts[self._scripts[:, kernels.S_ENDED] == 0, kernels.S_DUE_NS]
        self._due_ns, self._stale = int(live.min()) if len(live) else kernels.NEVER_NS, False


def _stay() -> None:
    """Move nothing."""
