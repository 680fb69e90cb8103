#!/usr/bin/env python3
"""Every benchmark compiles: its command of compile_commands.json, without the code generation that takes the time."""
import json
import os
import shlex
import subprocess
import sys

with open(sys.argv[1]) as file:
    entries = [e for e in json.load(file) if os.path.basename(e["file"]).startswith("bench_")]
failed = [] if entries else ["no benchmark in " + sys.argv[1]]
for entry in entries:
    words = shlex.split(entry["command"])
    at = words.index("-o")
    command = words[:at] + words[at + 2:] + ["-fsyntax-only"]
    if os.path.basename(command[0]) == "ccache":
        command = command[1:]
    if subprocess.run(command, cwd=entry["directory"]).returncode != 0:
        failed.append(entry["file"])
sys.exit("does not compile: " + ", ".join(failed) if failed else 0)
