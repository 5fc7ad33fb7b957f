"""The hullguard command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from hullguard import __version__
from hullguard.bus.lean import import_can
from hullguard.errors import HullguardError

STATUS = """exit status: 0 done; 1 the run failed or --expect was not met; 2 bad input; 3 the bus cannot be opened; 130 Ctrl-C (0 where that ends it: detect, monitor, inject)
"""

FREEZE = """a model may have its ECU keep the samples around a confirmed alarm, to be read with `hullguard freeze`:
  [freeze]
  samples = 16                 kept, 1 .. 255; 0 (default): none. RAM: of each 12 to 20 bytes, and 2 numbers a signal and residual
  after = 4                    of them after the alarm's, 0 .. samples - 1 (default: a quarter)
  frames_per_sample = 4        that an answer may send at most, 1 .. 255
  request = { id = 0x140 }     a frame of the detector's own, classic CAN, 8 bytes
  response = { id = 0x141 }    the same (default: the next identifier)
"""

EPILOG = f"""a fault SPEC is NAME:KIND[:SIZE]@START[..END], for example gap12_m:bias:0.5@100:
  NAME a signal or a fault of the model; KIND bias, drift (units a second), gain, freeze or noise; START and END sample indices

{STATUS}"""


class _Parser(argparse.ArgumentParser):
    """Errors are one line, like all others."""

    def error(self, message: str) -> NoReturn:
        """Status 2."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def _common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", metavar="MODEL", help="name of a shipped model, or path of a model file")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the model, e.g. groups.measurement.trigger.silence=1")
    parser.add_argument("--real", choices=["f32", "f64", "q31"], default="f32", help="number type of the C library (default f32)")
    _output(parser)


def _output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout, everything else on stderr")
    parser.add_argument("-q", "--quiet", action="store_true", help="no lines for people")


def _faults(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--fault", action="append", default=[], metavar="SPEC", help="a fault, instead of the scenario's; may be given more than once")
    parser.add_argument("--no-fault", action="store_true", help="none of the scenario's faults")


def _scenario(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenario", metavar="NAME", help="scenario of the model (default: its first)")


def _length(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--samples", type=_positive, metavar="N", help="number of samples")
    parser.add_argument("--seed", type=_seed, default=1, metavar="S", help="seed of every random number (default 1)")


def _positive(text: str) -> int:
    value = int(text) if text.lstrip("+-").isdigit() else 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return value


def _seed(text: str) -> int:
    value = int(text) if text.lstrip("+-").isdigit() else -1
    if not 0 <= value < 2**64:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number within 0 .. 2^64 - 1")
    return value


def _bus(parser: argparse.ArgumentParser) -> None:
    from can.cli import add_bus_arguments

    add_bus_arguments(parser, group_title="bus options of python-can")


def _expect(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--expect", choices=["detect", "quiet"], help="exit with status 1 unless every fault was found without a false alarm, or unless there was no alarm")


def _drive(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--bus",
        default="auto",
        metavar="BUS",
        help="auto (default): an existing vcan, else one made for the run, else none; inprocess: none; or a SocketCAN interface",
    )
    parser.add_argument("--speed", default="max", metavar="X", help="max (default), or a multiple of real time; 1 is real time, with the node's timer, any other in lockstep")
    parser.add_argument("--out", metavar="DIR", help="write run.log, run.json, signals.csv, labels.csv, the DBC and report.html there")
    parser.add_argument("--formats", metavar="F[,F..]", default="", help="with --out: the log as run.F too, F of pcap, pcapng, blf, mf4, asc")
    _expect(parser)
    _bus(parser)


def build_parser() -> argparse.ArgumentParser:
    """All options of all subcommands."""
    from hullguard.identify import arguments as identify
    from hullguard.inject import arguments as inject  # slow: what it needs is imported where a Ctrl-C is told in one line
    from hullguard.new import arguments as new

    parser = _Parser(
        prog="hullguard", description="Event-triggered, set-based fault detection on ECUs over CAN.", epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=f"hullguard {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return commands.add_parser(name, help=text, description=text, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)

    p = add("design", "check a model, find its detector, and write C tables, DBC and design report")
    p.epilog = f"{FREEZE}\n{EPILOG}"
    _common(p)
    p.add_argument("--out", metavar="DIR", help="folder for tables, DBC and report (default build/NAME)")
    p.add_argument("--fresh", action="store_true", help="search again even if NAME.design.toml fits the model")

    p.add_argument("--isolability", action="store_true", help="which faults can be told apart, also for a model without banks for isolation; a minute for many faults")
    p.add_argument("--sensors", metavar="NAME,..", action="append", default=[], help="would an unknown-input observer do with these outputs, or rate:STATE for an accelerometer?")

    p = add("run", "run a model: emulated plant, triggers, bus, detector node")
    _common(p)
    _scenario(p)
    _length(p)
    _faults(p)
    _drive(p)

    p = add("replay", "recorded signals through triggers, bus and detector")
    _common(p)
    p.add_argument("--csv", required=True, metavar="FILE", help="recording; its columns carry the model's signal names")
    p.add_argument("--noise", action="store_true", help="add the sensor noise that the model states, uniform and seeded")
    _length(p)
    _faults(p)
    _drive(p)

    p = add("detect", "the detector on any python-can interface, or on a recorded log")
    _common(p)
    _scenario(p)
    p.add_argument("--log", metavar="FILE", help="recording instead of a bus: .log (candump -L), .pcap, .pcapng, .blf, .mf4 or .asc")
    p.add_argument("--lockstep", action="store_true", help="answer every closing frame with a verdict; no deadline")
    p.add_argument("--rest", action="store_true", help="the plant starts within its initial range (default: anywhere in its range)")
    p.add_argument("--listen", action="store_true", help="send nothing")
    p.add_argument("--samples", type=_positive, metavar="N", help="stop after N samples")
    p.add_argument("--ready", action="store_true", help="print 'ready' once the bus is open")
    _expect(p)
    _bus(p)

    p = add("monitor", "live view of a bus or a log: signals with radii, residuals, verdicts, senders, load, losses")
    _common(p)
    _scenario(p)
    p.add_argument("--log", metavar="FILE", help="recording instead of a bus (formats as in detect): played at its own speed in the view, at once as lines")
    p.add_argument("--speed", metavar="X", help="max, or a multiple of the log's own speed")
    p.add_argument("--plain", action="store_true", help="lines of key=value, also where stdout is no terminal; --json: a JSON object a line")
    p.add_argument("--every", type=float, default=1.0, metavar="S", help="seconds between two such lines (default 1); a change has its own line at once")
    p.add_argument("--rate", type=float, default=5.0, metavar="HZ", help="pictures a second (default 5)")
    p.add_argument("--rest", action="store_true", help="the first frame is of a plant within its initial range (default: anywhere in its range)")
    p.add_argument("--lockstep", action="store_true", help="the bus keeps no time: no deadline for the closing frame")
    p.add_argument("--samples", type=_positive, metavar="N", help="stop after N samples")
    p.add_argument("--snapshot", action="append", default=[], metavar="FILE", help="the last screen as FILE.svg or FILE.txt; may be given more than once")
    _bus(p)

    p = add("freeze", "what an ECU knew in the samples around a confirmed alarm: read over the bus, shown as a table, and cleared")
    _common(p)
    p.add_argument("--csv", metavar="FILE", help="write all numbers there, a row a sample")
    p.add_argument("--clear", action="store_true", help="once it is read, let the ECU record again")
    _bus(p)

    p = add("plant", "the emulated plant and its senders alone, on a bus with a node of your own")
    _common(p)
    _scenario(p)
    _length(p)
    _faults(p)
    p.add_argument("--lockstep", action="store_true", help="wait for the node's verdict after every closing frame and compare it with this process's")
    p.add_argument("--moving", action="store_true", help="the node was started without --rest")
    p.add_argument("--speed", default="1", metavar="X", help="multiple of real time (default 1)")
    _bus(p)

    p = add("campaign", "many runs with different seeds, in C, on all cores")
    _common(p)
    _scenario(p)
    _length(p)
    _faults(p)
    p.add_argument("--runs", type=int, default=100, metavar="N", help="number of runs (default 100)")
    p.add_argument("--loss", default="0", metavar="P[,P..]", help="probability that a measurement frame is lost at the receiver; a list is a case each")
    p.add_argument("--loss-burst", default="0", metavar="L[,L..]", help="once a frame is lost, all of its group within L samples are")
    p.add_argument("--size", metavar="X[,X..]", help="size of every fault, instead of its own; a list is a case each")
    p.add_argument("--each-fault", action="store_true", help="one case a fault (default: all faults in every run)")
    p.add_argument("--vary", action="append", default=[], metavar="KEY=V1,V2..", help="like --set, a case and a design for each value; may be given more than once")
    p.add_argument("--limit", action="store_true", help="add the earliest detection that any sound detector could make, by linear programming, to each case")
    p.add_argument("--plants", type=_positive, default=0, metavar="M", help="emulate M plants drawn from the model's intervals in turn, half of them at corners")
    p.add_argument("--attack", type=float, default=0.0, metavar="SHARE", help="share of the runs whose disturbances are chosen against the detector, within the model's bounds")
    p.add_argument("--inject", action="append", default=[], metavar="SPEC", help="faulty frames: a directive of `inject`, or all; every counter is compared with the ledger")
    p.add_argument("--workers", type=_positive, metavar="N", help="processes (default: one a core); results do not depend on it")
    p.add_argument("--scheduler", metavar="ADDRESS", help="work on a Dask cluster instead: its scheduler's tcp://HOST:PORT, or local; the results are the same")
    p.add_argument("--table", metavar="FILE", help="all runs as a table, a row each: FILE.parquet or FILE.csv")
    p.add_argument("--out", metavar="DIR", help="write campaign.json, results.parquet and campaign.html there; a campaign that was interrupted goes on from what is there")
    _expect(p)

    p = add("limit", "delay of each detector beside the earliest that a sound one could have")
    _common(p)
    _scenario(p)
    _length(p)
    p.add_argument("--fault", action="append", default=[], metavar="NAME", help="a fault of the model, as a bias from the middle of the run on (default: each); may be repeated")
    p.add_argument("--size", default="0.5,1,2", metavar="X[,X..]", help="sizes of each fault (default 0.5,1,2)")
    p.add_argument("--runs", type=_positive, default=20, metavar="N", help="runs of each fault and size (default 20)")
    p.add_argument("--window", type=_positive, default=30, metavar="N", help="samples that the limit looks at (default 30)")
    p.add_argument("--workers", type=_positive, metavar="N", help="processes (default: one a core); results do not depend on it")

    p = add("new", "a first model file from matrices, a state-space file or a builder; asks where nothing is given")
    p.epilog = new.EPILOG
    new.add_arguments(p)
    _output(p)

    p = add("identify", "bounds of disturbances, noise and slews, and trigger settings, from recordings without faults: a model that is ready for design")
    p.epilog = identify.EPILOG
    identify.add_arguments(p, _seed)
    _output(p)

    p = add("convert", "recordings of CAN frames from one format into another, by suffix: .log (candump -L), .pcap, .pcapng, .blf, .mf4, .asc")
    p.add_argument("source", metavar="IN", help="recording to read")
    p.add_argument("target", metavar="OUT", help="file to write; with --dbc it may be .csv: signals for PlotJuggler")
    p.add_argument("--channel", metavar="NAME", help="only frames of this channel (default: all)")
    p.add_argument("--dbc", metavar="FILE", help="what the frames mean, for a .csv")
    _output(p)

    p = add("amalgam", "the C library and the tables of chosen models as two files, hullguard.h and hullguard.c")
    p.add_argument("models", nargs="+", metavar="MODEL", help="name of a shipped model, or path of a model file; more than one live in one image")
    p.add_argument("--out", metavar="DIR", default="build", help="folder for the two files (default build)")
    _output(p)

    p = add("inject", "faults on a bus, tapped or between two channels, or in a log")
    p.epilog = f"{inject.SPEC}\n{STATUS}"
    inject.add_arguments(p, _seed)
    _output(p)

    p = add("report", "draw report.html from the files of a run, or campaign.html from those of a campaign")
    p.add_argument("directory", metavar="DIR", help="the --out folder of a run or campaign")
    p.add_argument("--png", metavar="FILE", help="draw the run as one picture too")
    _output(p)
    return parser


def _commands() -> dict[str, Callable[[argparse.Namespace], int]]:
    from hullguard import commands
    from hullguard.codegen.amalgam import run_amalgam
    from hullguard.freeze.command import run_freeze
    from hullguard.identify.command import run_identify
    from hullguard.inject.command import run_inject
    from hullguard.monitor.command import run_monitor
    from hullguard.new.command import run_new

    return {
        "design": commands.run_design,
        "run": commands.run_run,
        "replay": commands.run_replay,
        "detect": commands.run_detect,
        "plant": commands.run_plant,
        "monitor": run_monitor,
        "freeze": run_freeze,
        "campaign": commands.run_campaign,
        "limit": commands.run_limit,
        "new": run_new,
        "identify": run_identify,
        "convert": commands.run_convert,
        "amalgam": run_amalgam,
        "inject": run_inject,
        "report": commands.run_report,
    }


def _of_kind(args: argparse.Namespace) -> Callable[[argparse.Namespace], int] | None:
    """What takes models of a kind that has commands of its own."""
    if args.command == "inject" or not getattr(args, "model", None):
        return None
    from hullguard.model import fusion

    if fusion.kind_of(args.model) != fusion.KIND:
        return None
    from hullguard.fusion_commands import dispatch

    return dispatch


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit status. Errors are one line on stderr that names the cause and the cure."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        import_can()
        args = build_parser().parse_args(given)  # what it imports takes long enough for a Ctrl-C
        args.arguments = given
        return (_of_kind(args) or _commands()[args.command])(args)
    except HullguardError as error:
        print(f"hullguard: {error}", file=sys.stderr)
        return error.status
    except (KeyboardInterrupt, ImportError) as error:
        if isinstance(error, ImportError) and not isinstance(error.__cause__, KeyboardInterrupt):  # a compiled module's start makes it one
            raise
        print("hullguard: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0


if __name__ == "__main__":
    sys.exit(main())
