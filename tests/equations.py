"""docs/bcsdf.md's table 'equation -> file and function': every function is in its file, and no equation twice.

Takes the repository's root."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
rows = re.findall(r"^\| (.+?) \| `([\w/.]+\.hpp)` \| `(\w+)` \|$", (root / "docs/bcsdf.md").read_text(), re.M)
assert len(rows) >= 15, f"docs/bcsdf.md: expected a table of 15 functions and more, found {len(rows)}"
bad = []
for equation, file, function in rows:
    path = root / "runtime/include/medulla" / file
    if not path.is_file():
        bad.append(f"{equation}: no file {file}")
    elif not re.search(rf"\b{function}\(", path.read_text()):
        bad.append(f"{equation}: no function {function} in {file}")
if len({row[0] for row in rows}) != len(rows):
    bad.append("an equation stands twice")
print("\n".join(bad) or f"{len(rows)} equations found in the runtime")
sys.exit(bool(bad))
