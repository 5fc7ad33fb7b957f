"""A gateway between two channels: gap12_m is 0.5 m too large from second 2 on, in frames whose checksum is right.

python host_tools/examples/gateway_bias.py NAME.dbc INTERFACE FROM TO [SECONDS]
python host_tools/examples/gateway_bias.py firmware/models/platoon.dbc socketcan vcan0 vcan1
"""

import sys
import time
from pathlib import Path

import can

from hullguard.bus.link import from_message, to_message
from hullguard.inject import Injector, parse_directive, read_codec

dbc, interface, plant, ecu = sys.argv[1:5]
seconds = float(sys.argv[5]) if len(sys.argv) > 5 else 60.0
injector = Injector([parse_directive("bias:signal=gap12_m,size=0.5@from=2")], read_codec(Path(dbc)))
with can.Bus(interface=interface, channel=plant) as near, can.Bus(interface=interface, channel=ecu) as far:
    started = time.monotonic()
    while (now := time.monotonic() - started) < seconds:
        message = near.recv(0.01)
        for sent in injector.take(from_message(message), now) if message else injector.due(now):
            far.send(to_message(sent.frame))
for row in injector.ledger.rows:
    print(f"{row.time_s:9.3f} {row.original} -> {row.sent}  {row.detail}")
