#!/usr/bin/python3
"""Includes go one way, as in CONTRIBUTING.md: no room includes a room above it. rooms.py SOURCE"""
import pathlib
import re
import sys

# Each room, and the rooms that its files may include.
ROOMS = {
    "runtime/include/medulla": set(),
    "sim2d": {"runtime/include/medulla"},
    "sim2d/disc": {"sim2d"},
    "sim2d/slab": {"sim2d"},
    "sim2d/reference": {"sim2d", "sim2d/slab"},
    "sim2d/tracer": {"sim2d", "sim2d/disc", "sim2d/slab"},
    "sim3d": {"runtime/include/medulla", "sim2d", "sim2d/tracer"},
    "sim3d/model": {"sim3d", "sim2d/disc", "sim2d/slab"},
    "tensor": set(),
    "plot": set(),
    "tables": set(),
    "tables/table": {"tables", "sim2d", "sim2d/disc", "sim2d/slab"},
    "tables/store": {"tables/table"},
    "tables/job": {"tables/store", "sim2d/tracer", "sim2d/reference"},
    "tables/pack": {"tables/store", "tensor"},
    "tables/bake": {"tables/job", "tensor", "sim3d/model"},
    "tables/programs": {"tables/bake", "tables/job", "tables/pack", "plot", "sim3d/model"},
}


def below(room):
    """A room and everything under it."""
    rooms = {room}
    for other in ROOMS[room]:
        rooms |= below(other)
    return rooms


def room_of(path):
    """The innermost room of a file, None outside all of them."""
    rooms = [room for room in ROOMS if path.startswith(room + "/")]
    return max(rooms, key=len, default=None)


def main():
    source, wrong, includes = pathlib.Path(sys.argv[1]), [], 0
    for file in sorted(source.rglob("*.[ch]pp")):
        path = file.relative_to(source).as_posix()
        room = room_of(path)
        if room is None:
            continue
        for target in re.findall(r'^\s*#\s*include "([^"]+)"', file.read_text(), re.MULTILINE):
            other = room_of("runtime/include/" + target if target.startswith("medulla/") else target)
            if other is None:
                continue
            includes += 1
            if other not in below(room):
                wrong.append(f"{path} includes {target}")
    print(f"{includes} includes between rooms")
    if wrong or includes < 100:  # fewer if the list of rooms above is out of date
        sys.exit("\n".join(wrong) or "expected at least 100 includes")


main()
