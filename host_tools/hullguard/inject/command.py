"""`hullguard inject`."""

from __future__ import annotations

import argparse
import contextlib
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hullguard.bus import candump, formats
from hullguard.bus.link import opened
from hullguard.commands import bus_options, emit, make_folder, prepared, say, signalled
from hullguard.errors import InputError
from hullguard.inject.actions import ACTIONS
from hullguard.inject.attach import attach, on_log, play
from hullguard.inject.codec import Codec, design_codec, read_codec
from hullguard.inject.directive import Directive, parse_directive, read_directives
from hullguard.inject.engine import Injector, Sent
from hullguard.inject.labels import Ledger
from hullguard.inject.options import declared
from hullguard.model import fusion

BUS_KEYS = ("channel", "interface", "bitrate", "fd", "data_bitrate", "timing")


def run_inject(args: argparse.Namespace) -> int:
    """`hullguard inject`."""
    if args.list:
        return _list(args)
    sides = _sides(args)
    if args.replay:
        return _replay(args, sides)
    directives = [d for path in args.file for d in read_directives(Path(path))] + [parse_directive(text) for text in args.do]
    if not directives:
        raise InputError("inject needs directives: --do SPEC or --file FILE; --list shows what there is")
    gateway = bool(args.log) or len(sides) == 2
    if not sides and not args.log and not args.dry_run:
        raise InputError("inject needs a bus (-i INTERFACE -c CHANNEL), two of them (--from-channel .. --to-channel ..), or a log (--log FILE)")
    if args.log and not args.out:
        raise InputError("--log needs --out DIR for what comes out")
    codec = _codec(args)
    if args.dry_run:
        return _dry_run(args, Injector(directives, codec, args.seed, gateway or not sides))
    with _files(args) as (ledger, sink):
        injector = Injector(directives, codec, args.seed, gateway, ledger)
        if args.log:
            for entry in on_log(injector, formats.read(Path(args.log))):
                sink(entry)
        else:
            _on_bus(args, injector, sides, sink)
    return _tell(args, injector, "log" if args.log else "gateway" if gateway else "tap")


def _sides(args: argparse.Namespace) -> list[dict[str, Any]]:
    """python-can's options of no bus, one (a tap), or two (a gateway)."""
    tap, near, far = bus_options(args), *(_prefixed(args, prefix) for prefix in ("from", "to"))
    if bool(near) != bool(far):
        raise InputError(f"a gateway has two sides: --{'to' if near else 'from'}-channel is missing")
    if sum(map(bool, (tap, near, args.log))) > 1:
        raise InputError("-i and -c make a tap, --from-.. and --to-.. a gateway, --log needs no bus: give one of them")
    if near and all(near.get(k) == far.get(k) for k in ("interface", "channel")):
        raise InputError("both sides of the gateway are one bus: every frame would go round for ever; give two channels")
    return [tap] if tap else [near, far] if near else []


def _prefixed(args: argparse.Namespace, prefix: str) -> dict[str, Any]:
    given = {k: getattr(args, f"{prefix}_{k}") for k in BUS_KEYS if hasattr(args, f"{prefix}_{k}")}
    return given | (getattr(args, f"{prefix}_bus_kwargs", None) or {})


def _codec(args: argparse.Namespace) -> Codec:
    """What is known by name: of a model, of a DBC, or nothing."""
    if not args.model:
        return Codec()
    if args.model.lower().endswith(".dbc"):
        if args.set:
            raise InputError("--set changes a model, and a DBC is none; name the model instead")
        return read_codec(Path(args.model))
    if fusion.kind_of(args.model) == fusion.KIND:
        from hullguard.fusion_commands import codec

        return codec(args)
    return design_codec(prepared(args)[1])


@contextlib.contextmanager
def _files(args: argparse.Namespace) -> Iterator[tuple[Ledger, Callable[[candump.Entry], object]]]:
    """The ledger, and where what is sent gets written."""
    if not args.out:
        yield Ledger(keep=False), lambda entry: None
        return
    out = Path(args.out)
    make_folder(out)
    ledger = Ledger(out / "labels.csv")
    try:
        with (out / "injected.log").open("w", encoding="ascii") as log:
            yield ledger, lambda entry: log.write(candump.line(entry.time_s, entry.channel, entry.frame) + "\n")
    finally:
        ledger.close()


def _until(args: argparse.Namespace, stopped: Callable[[], bool]) -> Callable[[], bool]:
    end = None if args.duration is None else time.monotonic() + args.duration
    return lambda: stopped() or (end is not None and time.monotonic() >= end)


def _on_bus(args: argparse.Namespace, injector: Injector, sides: list[dict[str, Any]], sink: Callable[[candump.Entry], object]) -> None:
    twins = any(d.action == "fdtwin" for d in injector.directives)
    if twins or any(x.flags & candump.FD for x in injector.traffic.codec.layouts):
        sides = [{"fd": True} | side for side in sides]
    with signalled() as stopped, contextlib.ExitStack() as stack:
        links = [stack.enter_context(opened(**side)) for side in sides]
        names = [str(side.get("channel")) for side in sides]
        say(args, f"gateway from {names[0]} to {names[1]}" if len(names) == 2 else f"tap on {names[0]}")

        def note(sent: Sent) -> None:
            sink(candump.Entry(sent.time_s, names[-1], sent.frame))

        attach(injector, links[0], links[1] if len(links) == 2 else None, _until(args, stopped), note, lambda: print("ready", flush=True) if args.ready else None)


def _replay(args: argparse.Namespace, sides: list[dict[str, Any]]) -> int:
    if args.do or args.file or args.log:
        raise InputError("--replay sends what was recorded: leave --do, --file and --log out")
    if not sides:
        raise InputError("--replay needs a bus: -i INTERFACE -c CHANNEL")
    entries = list(formats.read(Path(args.replay)))
    if args.dry_run:
        say(args, f"{len(entries)} frames to be sent")
        return 0
    side = sides[-1] | ({"fd": True} if any(e.frame.flags & candump.FD for e in entries) else {})
    with signalled() as stopped, opened(**side) as link:
        if args.ready:
            print("ready", flush=True)
        sent = play(entries, link, _until(args, stopped), args.speed)
    say(args, f"{sent} of {len(entries)} frames sent on {side.get('channel')}")
    emit(args, {"mode": "replay", "sent": sent})
    return 0


def _dry_run(args: argparse.Namespace, injector: Injector) -> int:
    for d in injector.directives:
        say(args, f"{d.name}: {d.spec}")
    emit(args, {"mode": "dry-run", "directives": [_row(d, injector) for d in injector.directives]})
    return 0


def _row(d: Directive, injector: Injector) -> dict[str, Any]:
    return {"name": d.name, "action": d.action, "spec": d.spec, "events": injector.ledger.events[d.name]}


def _tell(args: argparse.Namespace, injector: Injector, mode: str) -> int:
    """What was done, for people and for machines."""
    ledger = injector.ledger
    result = {
        "mode": mode, "seed": args.seed, "frames": injector.traffic.frames, "sent": injector.sent, "events": sum(ledger.events.values()),
        "directives": [_row(d, injector) for d in injector.directives], "actions": dict(ledger.actions), "expects": dict(ledger.expects),
    }  # fmt: skip
    say(args, f"{result['frames']} frames came in, {result['sent']} were sent")
    for d in injector.directives:
        say(args, f"{d.name}: {ledger.events[d.name]} events ({d.spec})")
    if args.out:
        (Path(args.out) / "inject.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        say(args, f"injected.log and labels.csv are in {args.out}")
    emit(args, result)
    return 0


def described() -> list[dict[str, Any]]:
    """Every action as --list shows it."""
    rows = []
    for name, kind in ACTIONS.items():
        options = {}
        for f in declared(kind):
            m = f.metadata
            values = " (" + ", ".join(m["choices"]) + ")" if m["choices"] else ""
            default = "needed" if m.get("required") else "" if f.default in (None, "") else f"default {str(f.default).lower() if isinstance(f.default, bool) else f.default}"
            options[f.name] = m["about"] + values + (f"; {default}" if default else "")
        copies = any(f.name == "copy" for f in declared(kind))
        tap = "yes" if not kind.needs_gateway or (copies and kind.__dataclass_fields__["copy"].default) else "with copy=true" if copies else "no"
        rows.append({"action": name, "about": kind.about, "tap": tap, "example": kind.example, "options": options, "expects": list(kind.expects), "also": list(kind.also)})
    return rows


def _list(args: argparse.Namespace) -> int:
    rows = described()
    for r in rows:
        say(args, f"{r['action']}: {r['about']}")
        for name, about in r["options"].items():
            say(args, f"    {name}: {about}")
        counters = " or ".join(r["expects"]) + (f"; besides {', '.join(r['also'])}" if r["also"] else "")
        say(args, f"    tap: {r['tap']}; a receiver counts: {counters}")
        say(args, f"    example: {r['example']}")
    emit(args, {"actions": rows})
    return 0
