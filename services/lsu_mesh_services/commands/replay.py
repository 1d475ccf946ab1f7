"""``lsu-mesh replay FILE``: a recording again, verified, through other filters, or live."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lsu_mesh_services.bank_limits import refuses_bank
from lsu_mesh_services.exit_codes import NOT_MET, USAGE
from lsu_mesh_services.recording.read import Recording, read_recording


def main(options: argparse.Namespace) -> int:
    problem = _contradiction(options)
    if problem:
        print(f"replay: {problem}", file=sys.stderr)
        return USAGE
    recording = read_or_explain(Path(options.file))
    if recording is None:
        return USAGE
    if options.verify:
        from lsu_mesh_services.replay.verify import verify_recording

        return verify_recording(recording, as_json=options.json)
    if not recording.received:
        print(f"{options.file}: holds no messages", file=sys.stderr)
        return NOT_MET
    if refuses_bank(recording.configuration, "replay"):
        return USAGE
    if options.live:
        from lsu_mesh_services.replay.live import replay_live

        return replay_live(recording, options)
    from lsu_mesh_services.replay.recompute import replay_again

    return replay_again(recording, options)


def _contradiction(options: argparse.Namespace) -> str:
    given = {
        "--with": options.other,
        "--smooth": options.smooth,
        "--record": options.record,
        "-X": options.overrides,
    }
    changes = [flag for flag, value in given.items() if value]
    if options.verify and changes:
        return f"--verify recomputes what was recorded; leave out {', '.join(changes)}"
    if options.live and options.smooth:
        return "--smooth recomputes in this process, --live runs peers; leave one of them out"
    return ""


def read_or_explain(path: Path) -> Recording | None:
    """The recording, or None after stderr has been told what is wrong."""
    try:
        recording = read_recording(path)
    except OSError as error:
        print(f"{path}: cannot be read: {error.strerror or error}", file=sys.stderr)
        return None
    except (ValueError, RuntimeError) as error:
        print(error, file=sys.stderr)
        return None
    if len(recording.files) > 1:
        print(f"in {len(recording.files)} parts: {', '.join(file.name for file in recording.files)}", file=sys.stderr)
    return recording
