#!/usr/bin/python3
"""fur-render as a user runs it: options, files, exit statuses, one line per error (docs/render.md)."""
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest

SCENES = os.path.abspath(sys.argv.pop())
BIN = os.path.abspath(sys.argv.pop())
SMALL = ["--width", 24, "--height", 24, "--progress", "none"]
PATCH = {"camera": {"from": [0, 3, 4], "to": [0, 0, 0], "fov": 10},
         "materials": [{"name": "fox", "preset": "red_fox"}],
         "objects": [{"shape": "patch", "width": 2, "depth": 2, "coat": [{"material": "fox", "density": 100}]}],
         "lights": [{"light": "sky"}]}


def run(*options, cwd):
    done = subprocess.run([os.path.join(BIN, "fur-render"), *map(str, options)], capture_output=True, text=True, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


def bytes_of(path):
    with open(path, "rb") as file:
        return file.read()


def form_of_png(path):
    """Width, height, bits, colour type."""
    data = bytes_of(path)
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">IIBB", data[16:26])


class FurRender(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.cwd = self.folder.name
        self.write("patch.json", PATCH)

    def tearDown(self):
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.cwd, name)

    def write(self, name, scene):
        with open(self.path(name), "w") as file:
            json.dump(scene, file)

    def fails(self, status, *options, names=()):
        code, out, err = run(*options, cwd=self.cwd)
        self.assertEqual((code, out), (status, ""), (options, err))
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        for name in names:
            self.assertIn(name, err)

    def test_errors(self):
        self.assertEqual(run("--help", cwd=self.cwd)[0], 0)
        self.assertRegex(run("--version", cwd=self.cwd)[1], r"medulla \d+\.\d+\.\d+")
        for words in ([], ["patch.json"], ["patch.json", "-o", "x.jpg"], ["patch.json", "-o", "x.png", "--spp", 0],
                      ["patch.json", "-o", "x.png", "--field", "middle"], ["patch.json", "-o", "x.png", "--error", "-1"],
                      ["patch.json", "-o", "x.png", "--lobes", "R,TTT"],
                      ["patch.json", "-o", "x.png", "--model", "deon", "--lobes", "R"], ["patch.json", "-o", "x.png", "-o", "y.gif"],
                      ["patch.json", "-o", "x.png", "--layers"], ["patch.json", "-o", "x.png", ""], ["patch.json", "-o", "x.png", "--nonsense"]):
            self.fails(2, *words)
        self.fails(2, "patch.json", "-o", "x.png", "--model", "phong", names=["--model: phong not in", "kajiya-kay", "yan2015"])
        self.fails(1, "absent.json", "-o", "x.png", names=["absent.json", "No such file"])
        self.fails(1, ".", "-o", "x.png", names=[".: "])
        self.fails(1, "patch.json", "-o", "nowhere/x.png", "--spp", 1, *SMALL, names=["nowhere/x.png"])
        self.fails(1, "patch.json", "-o", "nowhere/x.exr", "--spp", 1, *SMALL, names=["nowhere/x.exr"])
        bad = json.loads(json.dumps(PATCH))
        bad["objects"][0]["coat"][0]["density"] = -3
        self.write("bad.json", bad)
        self.fails(1, "bad.json", "-o", "x.png", names=["bad.json: /objects/0/coat/0/density", "> 0", "found -3"])
        self.assertEqual(sorted(os.listdir(self.cwd)), ["bad.json", "patch.json"])

    def test_picture_and_json(self):
        code, out, err = run("patch.json", "-o", "x.png", "--spp", 4, "--json", "--stats", *SMALL, cwd=self.cwd)
        self.assertEqual((code, err), (0, ""))
        report = json.loads(out)
        self.assertEqual(form_of_png(self.path("x.png")), (24, 24, 8, 2))
        self.assertEqual((report["nonfinite"], report["samples"], len(report["mean"])), (0, 4, 3))
        self.assertTrue(all(0 < c < 1 for c in report["mean"]), report)
        self.assertGreater(report["vertices_per_second"], 0)
        self.assertGreater(report["rays"], report["vertices"])
        self.assertTrue(0 < report["traversal"] < 1 and 0 < report["shading"] < 1)
        self.assertEqual(sorted(os.listdir(self.cwd)), ["patch.json", "x.png"])

    def test_streams(self):
        """Progress may be lost; a report that cannot be written is an error."""
        words = [os.path.join(BIN, "fur-render"), "patch.json", "-o", "x.png", "--spp", "16", "--width", "64", "--height",
                 "64", "--progress", "bar", "--threads", "2"]
        with open("/dev/full", "w") as full:
            done = subprocess.run(words, stdout=subprocess.PIPE, stderr=full, text=True, cwd=self.cwd)
            self.assertEqual(done.returncode, 0)
            self.assertIn("16 samples", done.stdout)
            done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, cwd=self.cwd)
            self.assertEqual(done.returncode, 1)
            self.assertIn("standard output: cannot be written", done.stderr)
        done = subprocess.run(["/bin/sh", "-c", '"$0" "$@" 2>&-', *words], stdout=subprocess.PIPE, cwd=self.cwd)
        self.assertEqual(done.returncode, 0)
        self.assertEqual(form_of_png(self.path("x.png")), (64, 64, 8, 2))
        os.symlink("/dev/full", self.path("full.png"))
        for size in (8, 256):  # that fail as the file is closed, and before
            self.fails(1, "patch.json", "-o", "full.png", "--spp", 1, "--progress", "none", "--width", size, "--height",
                       size, names=["full.png: cannot be written: "])
        self.assertIn("No space left", run("patch.json", "-o", "full.png", "--spp", 1, "--progress", "none", "--width", 8,
                                           "--height", 8, cwd=self.cwd)[2])

    def test_bytes(self):
        pictures = set()
        for threads in (1, 2):
            self.assertEqual(run("patch.json", "-o", "x.png", "--spp", 9, "--threads", threads, *SMALL, cwd=self.cwd)[0], 0)
            pictures.add(bytes_of(self.path("x.png")))
        self.assertEqual(len(pictures), 1)
        self.assertEqual(run("patch.json", "-o", "x.png", "--spp", 9, "--seed", 1, *SMALL, cwd=self.cwd)[0], 0)
        self.assertNotIn(bytes_of(self.path("x.png")), pictures)

    def test_lobes(self):
        """Each lobe alone is dimmer than all of them; the skin, which has none, shows in every picture."""
        means = {}
        for lobes in ("R", "TT", "TRT", "TTs", "TRTs", "residual", "R,TT,TRT,TTs,TRTs,residual", None):
            words = ["--lobes", lobes] if lobes else []
            code, out, err = run("patch.json", "-o", "x.png", "--spp", 16, "--json", *words, *SMALL, cwd=self.cwd)
            self.assertEqual((code, err), (0, ""))
            means[lobes] = json.loads(out)["mean"][1]
        everything = means.pop(None)
        self.assertEqual(everything, means.pop("R,TT,TRT,TTs,TRTs,residual"))
        for lobe, mean in means.items():
            self.assertTrue(0 < mean < everything, (lobe, means, everything))
        self.assertEqual(len(set(means.values())), 6)

    def test_time(self):
        code, out, err = run("patch.json", "-o", "y.png", "-o", "x.exr", "--time", 0.2, "--json", *SMALL, cwd=self.cwd)
        self.assertEqual((code, err), (0, ""))
        self.assertGreaterEqual(json.loads(out)["seconds"], 0.2)
        self.assertEqual(bytes_of(self.path("x.exr"))[:4], b"\x76\x2f\x31\x01")
        self.assertNotIn(b"lobe_TT.R", bytes_of(self.path("x.exr")))
        self.assertEqual(run("patch.json", "-o", "x.exr", "--layers", "--spp", 1, *SMALL, cwd=self.cwd)[0], 0)
        self.assertIn(b"lobe_TT.R", bytes_of(self.path("x.exr")))

    def test_layer_pictures(self):
        """A PNG for each lobe and for direct and indirect light; the picture is the same bytes without them."""
        names = ["R", "TT", "TRT", "TTs", "TRTs", "residual", "direct", "indirect"]
        self.assertEqual(run("patch.json", "-o", "with.png", "--layer-pictures", "layer_", "--spp", 8, *SMALL, cwd=self.cwd)[0], 0)
        self.assertEqual(run("patch.json", "-o", "without.png", "--spp", 8, *SMALL, cwd=self.cwd)[0], 0)
        self.assertEqual(bytes_of(self.path("with.png")), bytes_of(self.path("without.png")))
        pictures = [bytes_of(self.path("layer_%s.png" % name)) for name in names]
        self.assertGreaterEqual(len(set(pictures)), 6)  # TRT, TRTs and the residual lobe may be black
        for picture in pictures:
            self.assertEqual(picture[:8], b"\x89PNG\r\n\x1a\n")

    def test_scenes_that_ship(self):
        """Each is one that the program takes; the furnace's mean is 1 to 5 standard errors of the picture's mean."""
        for name in sorted(name for name in os.listdir(SCENES) if name.endswith(".json")):
            code, out, err = run(os.path.join(SCENES, name), "-o", "x.png", "--spp", 16 if name == "furnace.json" else 1,
                                 "--json", "--density", 1 if name == "furnace.json" else 0.02, *SMALL, cwd=self.cwd)
            self.assertEqual((code, err), (0, ""), name)
            report = json.loads(out)
            self.assertEqual(report["nonfinite"], 0, name)
            if name == "furnace.json":
                for channel in report["mean"]:
                    self.assertLess(abs(channel - 1), 5 * report["error"] / 24)


if __name__ == "__main__":
    unittest.main()
