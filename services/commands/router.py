"""``lsu-mesh router``: a Zenoh router in this process."""

from __future__ import annotations

import argparse
import sys
import time

from services.bus import Bus, Clock, NoSession, SessionSettings
from services.cli import COULD_NOT_START, OK
from services.peer import LONGEST_WAIT, Stop

DEFAULT_LISTEN = "tcp/127.0.0.1:7447"


def main(options: argparse.Namespace) -> int:
    settings = SessionSettings(
        connect=tuple(options.connect),
        listen=tuple(options.listen) or (DEFAULT_LISTEN,),
        mode=options.mode or "router",
        multicast=options.multicast_scouting,
        zenoh=tuple(options.cfg),
    )
    stop = Stop()
    try:
        with Bus(settings, Clock()):
            print(f"router: listening on {', '.join(settings.listen)}", file=sys.stderr)
            while not stop:
                time.sleep(LONGEST_WAIT)
    except NoSession as error:
        print(error, file=sys.stderr)
        return COULD_NOT_START
    return OK
