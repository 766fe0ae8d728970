"""python -m identikal: the command line tool."""

import signal
import sys

from . import _identikal

signal.signal(signal.SIGINT, signal.SIG_DFL)  # the tool has its own way to stop
sys.exit(_identikal.tool(["identikal", *sys.argv[1:]]))
