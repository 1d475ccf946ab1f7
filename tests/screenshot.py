"""Pictures of the tabs of a recording: ``python tests/screenshot.py FILE.rrd FOLDER [--tab NAME …] [--step K]``."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from headless_viewer import HeadlessViewer, why_not


def main(arguments: list[str] | None = None) -> int:
    """Write one PNG per tab; 1 if the viewer complains about anything, 2 if it cannot run."""
    options = parse(arguments)
    reason = why_not()
    if reason is not None:
        print(f"screenshot: {reason}", file=sys.stderr)
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    with HeadlessViewer() as viewer:
        viewer.open(options.file)
        tabs = viewer.tabs()
        if unknown := sorted(set(options.tab) - set(tabs)):
            print(f"screenshot: no tab {unknown}; tabs: {tabs}", file=sys.stderr)
            return 2
        if options.step is not None:
            viewer.go_to(options.step)
        for number, tab in enumerate(tabs):
            if not options.tab or tab in options.tab:
                viewer.show(tab)
                target = options.folder / f"{number}-{re.sub('[^a-z0-9]+', '-', tab.lower()).strip('-')}.png"
                viewer.picture(target)
                print(target)
        complaints = viewer.complaints()
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if complaints else 0


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help="recording")
    parser.add_argument("folder", type=Path, help="where the PNGs go")
    parser.add_argument("--tab", action="append", default=[], help="only this tab; may be given several times")
    parser.add_argument("--step", type=int, help="step at which to look (default: the last, as the recording opens)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
