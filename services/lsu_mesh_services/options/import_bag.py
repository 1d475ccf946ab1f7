"""Options of ``lsu-mesh import``."""

from __future__ import annotations

from lsu_mesh_services.extras import ROS2
from lsu_mesh_services.options.parsing import Commands, new_command


def add(commands: Commands) -> None:
    """The command ``import``."""
    parser = new_command(commands, "import", "make a file of measurements from a bag of ROS 2 (MCAP or rosbag2)")
    parser.epilog = (
        f"example:\n  lsu-mesh import drive.mcap --topic /fix --fields latitude,longitude -o fix.csv\n\n{parser.epilog}"
    )
    parser.add_argument("file", metavar="BAG", help="a file .mcap or .db3, or the folder of a rosbag2")
    parser.add_argument("--topic", metavar="TOPIC", help="topic to take (default: list the topics)")
    parser.add_argument(
        "--fields",
        metavar="A,B",
        help="paths into a message, such as pose.position.x or ranges[3] (default: list them)",
    )
    parser.add_argument(
        "--stamp", choices=("header", "receive"),
        help="times of the headers, or when the bag received the messages (default: header where there is one)",
    )  # fmt: skip
    parser.add_argument("-o", "--output", metavar="FILE", help="CSV file to write (default: standard output)")
    parser.add_argument("--force", action="store_true", help="write over a file that is there")
    parser.set_defaults(handler="lsu_mesh_services.commands.import_bag", extra=ROS2)
