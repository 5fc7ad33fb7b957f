"""The injector: frames in, frames out, no bus and no clock. Directives work one behind another, each on what those before it let through or send."""

from __future__ import annotations

import heapq
import itertools
import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from random import Random

from hullguard.bus.candump import ERROR, EXTENDED
from hullguard.core.native import Frame
from hullguard.errors import InputError
from hullguard.inject.actions import ACTIONS
from hullguard.inject.codec import Codec
from hullguard.inject.directive import EXTENDED_MAX, Directive, named
from hullguard.inject.labels import Label, Ledger, text
from hullguard.inject.options import fill
from hullguard.inject.shot import Action, Pending, Shot, Traffic

TAP = "put a gateway between two channels with --from-channel and --to-channel"


@dataclass(frozen=True)
class Sent:
    """One frame to send, and when."""

    time_s: float
    frame: Frame
    expects: str = ""  # of the label that tells of it: health counters of a receiver, one of which it raises; empty: nobody touched it


class _Stage:
    """One directive at work."""

    def __init__(self, directive: Directive, traffic: Traffic, seed: int, gateway: bool) -> None:
        self.directive, self.trigger, self.traffic = directive, directive.trigger, traffic
        # Keyed by the name: another directive, before or behind, moves none of these numbers.
        self.seed = seed if directive.seed is None else directive.seed
        self.random = Random(f"{self.seed}/{directive.name}")
        self.action: Action = fill(ACTIONS[directive.action], directive.options, directive.where)
        reason = self.action.gateway_only()
        if reason and not gateway:
            raise InputError(f"{directive.where}: a tap cannot {reason}, it only adds frames; {TAP}")
        if self.trigger.timed and not self.action.at_moments():
            raise InputError(f"{directive.where}: {directive.action} works on frames, which at= and period= do not choose; use from=, nth= or count=")
        self._matches = self._fired = 0
        self._count = self.trigger.count or (1 if self.action.once and not self.trigger.selective else 0)
        self._resolve(traffic.codec)

    def _resolve(self, codec: Codec) -> None:
        """Names to identifiers; every name must be known."""
        d, t = self.directive, self.trigger
        try:
            about = self.action.prepare(codec)
            named = [(codec.message(i.text) if i.id is None else None, i) for i in t.ids]
            for name in t.when.names if t.when else ():
                self.traffic.watched[name] = codec.signal(name)
        except InputError as error:
            raise InputError(f"{d.where}: {error}") from error
        if t.k_start is not None and codec.closing is None:
            raise InputError(f"{d.where}: k= counts closing frames, which a DBC does not tell; name the model instead, or use from= and to=")
        self._ids = [(i.id or 0, i.mask, i.extended) if m is None else (m.id, EXTENDED_MAX, bool(m.flags & EXTENDED)) for m, i in named]
        self._ids += [(m.id, EXTENDED_MAX, bool(m.flags & EXTENDED)) for m in about if not t.ids]

    def wants(self, frame: Frame) -> bool:
        """Whether it is one of the frames that the directive is about."""
        if frame.flags & ERROR:
            return False
        extended = bool(frame.flags & EXTENDED)
        return not self._ids or any(frame.id & mask == number and extended == wide for number, mask, wide in self._ids)

    @property
    def spent(self) -> bool:
        """Whether it has fired as often as it may."""
        return bool(self._count) and self._fired >= self._count

    def fires(self, time_s: float, moment: bool) -> bool:
        """Whether the trigger chooses this frame or moment."""
        t = self.trigger
        if t.timed != moment or not t.start_s <= time_s < t.end_s or (t.when and not t.when.holds(self.traffic.values)):
            return False
        if t.k_start is not None and not t.k_start <= self.traffic.k < (math.inf if t.k_end is None else t.k_end):
            return False
        self._matches += 1
        if (t.nth and self._matches != t.nth) or self._matches % t.every or self.spent or (t.p < 1.0 and self.random.random() >= t.p):
            return False
        self._fired += 1
        return True

    def moments(self) -> Iterable[float]:
        """When to wake it."""
        t = self.trigger
        if t.at_s is not None:
            return [t.at_s]
        period = t.period_s
        return () if period is None else itertools.takewhile(lambda x: x < t.end_s, (t.start_s + n * period for n in itertools.count()))


class Injector:
    """Directives on a stream of frames.

    gateway: what take() returns goes on instead of the frame; else (a tap) it is sent besides, and directives that would need more are refused.
    Time is in seconds since the start and never goes back. The same frames, times and seed give the same frames, byte for byte.
    """

    def __init__(self, directives: Iterable[Directive], codec: Codec | None = None, seed: int = 1, gateway: bool = True, ledger: Ledger | None = None) -> None:
        self.directives = named(directives)
        self.traffic, self.ledger, self.seed, self.sent = Traffic(codec or Codec()), ledger or Ledger(), seed, 0
        self._gateway = gateway
        self._stages = [_Stage(d, self.traffic, seed, gateway) for d in self.directives]
        self._moments = [iter(s.moments()) for s in self._stages]
        self._queue: list[tuple[float, int, Pending]] = []
        self._order = itertools.count()
        for i in range(len(self._stages)):
            self._wake(i)

    def wants(self, frame: Frame) -> bool:
        """Whether a directive is about frames like this one."""
        return any(s.wants(frame) and (not s.trigger.timed or s.action.lasting) for s in self._stages)

    def _push(self, time_s: float, pending: Pending) -> Pending:
        heapq.heappush(self._queue, (time_s, next(self._order), pending))
        return pending

    def _wake(self, stage: int) -> None:
        at = next(self._moments[stage], None)
        if at is not None and not self._stages[stage].spent:
            self._push(at, Pending(None, stage))

    def take(self, frame: Frame, time_s: float) -> list[Sent]:
        """A frame that came in; what goes out until then, and for it."""
        out = self.due(time_s)
        index = self.traffic.frames
        closes = self.traffic.note(frame)
        out += self._run(Pending(frame, 0, True, index), time_s)
        self.traffic.k += int(closes)
        return out

    def due(self, time_s: float) -> list[Sent]:
        """What goes out until then without a frame coming in."""
        out: list[Sent] = []
        while (at := self.next_due()) is not None and at <= time_s:
            _, _, pending = heapq.heappop(self._queue)
            pending.over = True
            out += self._run(pending, at)
        return out

    def next_due(self) -> float | None:
        """When due() has something to do, at the latest; None: never."""
        while self._queue and self._queue[0][2].over:
            heapq.heappop(self._queue)
        return self._queue[0][0] if self._queue else None

    def finish(self) -> list[Sent]:
        """The frames that are still on their way, at their times; moments that have not come will not."""
        self._queue = [x for x in self._queue if x[2].frame is not None]
        heapq.heapify(self._queue)
        self._moments = [iter(()) for _ in self._stages]
        return self.due(math.inf)

    def _run(self, first: Pending, time_s: float) -> list[Sent]:
        """One frame or moment through all directives behind; depth first, so that the order of what comes out is that of the directives."""
        out: list[Sent] = []
        todo = deque([first])
        while todo:
            item = todo.popleft()
            if item.stage < len(self._stages):
                todo.extendleft(reversed(self._process(item, time_s)))
            elif item.frame is not None and (self._gateway or not item.real):
                out.append(Sent(time_s, item.frame, item.told))
        self.sent += len(out)
        return out

    def _process(self, item: Pending, time_s: float) -> list[Pending]:
        """What one directive makes of one frame or moment."""
        stage, beyond = self._stages[item.stage], item.stage + 1
        if item.frame is not None and not stage.wants(item.frame):
            return [replace(item, stage=beyond, over=False)]
        further: list[Pending] = []
        made_here: list[Pending] = []
        told = ""

        def send(frame: Frame, delay_s: float = 0.0, original: bool | Pending = False) -> Pending:
            """`original`: it is the frame itself that goes on its way, or the one that was held here."""
            origin = original if isinstance(original, Pending) else item
            made = Pending(frame, beyond, bool(original) and origin.real, origin.index, told=original.told if isinstance(original, Pending) else told)
            made_here.append(made)
            if delay_s > 0.0:
                return self._push(time_s + delay_s, made)
            further.append(made)
            return made

        def label(sent: Sequence[Frame], detail: str = "", expects: str | None = None, delay_s: float = 0.0) -> None:
            nonlocal told
            told = "|".join(stage.action.expects) if expects is None else expects
            self._label(stage, item, sent, detail, told, time_s + delay_s)

        shot = Shot(item.frame, time_s, stage.random, self.traffic, send, label)
        fires = stage.fires(time_s, item.frame is None)
        if item.frame is None:
            if fires:
                stage.action.fire(shot)
            self._wake(item.stage)
            left = None
        else:
            left = stage.action.fire(shot) if fires else stage.action.passing(shot)
        for made in made_here:
            made.told = made.told or told or item.told
        kept = [] if left is None else [Pending(left, beyond, item.real, item.index, told=item.told if left is item.frame else told or item.told)]
        return kept + further

    def _label(self, stage: _Stage, item: Pending, sent: Sequence[Frame], detail: str, expects: str, time_s: float) -> None:
        d = stage.directive
        original = text(item.frame) if item.frame is not None else ""
        k = self.traffic.k if self.traffic.codec.closing is not None else None
        self.ledger.add(Label(time_s, k, d.name, d.action, item.index, original, " ".join(text(f) for f in sent), expects, detail, stage.seed))
