"""A tap, a second talker on one channel: a forged measurement every half second, and a flood of identifier 0 in the fourth second.

python host_tools/examples/tap_spoof.py NAME.dbc INTERFACE CHANNEL [SECONDS]
python host_tools/examples/tap_spoof.py firmware/models/platoon.dbc socketcan vcan0
"""

import sys
import time
from pathlib import Path

import can

from hullguard.bus.link import from_message, to_message
from hullguard.inject import Injector, parse_directive, read_codec

dbc, interface, channel = sys.argv[1:4]
seconds = float(sys.argv[4]) if len(sys.argv) > 4 else 10.0
directives = [parse_directive("spoof:message=measurement,set=gap12_m=5@period=0.5"), parse_directive("flood:id=0,rate=200,lasts=1@at=3")]
injector = Injector(directives, read_codec(Path(dbc)), seed=7, gateway=False)
with can.Bus(interface=interface, channel=channel) as bus:
    started = time.monotonic()
    while (now := time.monotonic() - started) < seconds:
        message = bus.recv(0.005)
        for sent in injector.take(from_message(message), now) if message else injector.due(now):
            bus.send(to_message(sent.frame))
print(", ".join(f"{name}: {count} frames" for name, count in injector.ledger.events.items()))
