"""A recorded log, falsified without any bus: directives of a YAML file in, another log out, and the truth beside it.

python host_tools/examples/offline_log.py NAME.dbc FAULTS.yaml IN.log OUT.log
hullguard run platoon --bus inprocess --no-fault --out build/healthy
python host_tools/examples/offline_log.py firmware/models/platoon.dbc host_tools/examples/faults.yaml build/healthy/run.log build/faulty.log
hullguard detect platoon --rest --log build/faulty.log
"""

import sys
from pathlib import Path

from hullguard.bus import candump
from hullguard.inject import Injector, read_codec, read_directives
from hullguard.inject.attach import on_log

dbc, faults, source, target = map(Path, sys.argv[1:5])
injector = Injector(read_directives(faults), read_codec(dbc), seed=7)
log = candump.Writer(target, "vcan0")
for entry in on_log(injector, candump.read(source)):
    log.write(entry.time_s, entry.frame)
log.close()
for row in injector.ledger.rows:
    print(f"{row.time_s:9.3f} {row.directive}: {row.original} -> {row.sent or '(nothing)'}  {row.detail}; a receiver counts {row.expects}")
