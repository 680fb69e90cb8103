#!/usr/bin/python3
"""medulla-precompute --error-map: the page, its numbers as JSON, and bad input. error_map.py BIN"""
import html.parser
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import unittest

from support.runs import CLEAN

BIN = os.path.abspath(sys.argv.pop(1))
# A thin medulla of isotropic scatterers: the model's solvers need the least time for it.
MATERIAL = {"name": "thin <b> & co", "preset": "raccoon", "sigma_ms": 0.5, "g": 0, "sigma_ca": [0.1, 0.3, 0.9]}
VOID = {"meta", "br"}


class Page(html.parser.HTMLParser):
    """Tables as rows of texts; checks that every element is closed and that nothing is loaded."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tables, self.text, self.ids = [], [], "", []
        self.feed(text)
        assert self.open == [], self.open

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        assert tag not in ("script", "link", "img", "iframe", "object"), tag
        assert not {"src", "href", "onload"} & set(values), values
        if tag in VOID:
            return
        self.open.append(tag)
        if tag == "table":
            self.tables.append({"class": values.get("class", ""), "rows": []})
        elif tag == "tr":
            self.tables[-1]["rows"].append([])
        elif tag in ("td", "th"):
            self.tables[-1]["rows"][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        self.text += data
        if "td" in self.open or ("th" in self.open and "table" in self.open):
            self.tables[-1]["rows"][-1][-1] += data


def number(text):
    return float(re.match(r"[+−]?[\d.]+", text.strip()).group().replace("−", "-"))


class ErrorMap(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.material = os.path.join(cls.folder.name, "m.json")
        with open(cls.material, "w") as f:
            json.dump(MATERIAL, f)
        done = cls.run_in("--fibre", "m.json", "--error-map", "m.html", "--paths", 320, "--threads", 1, "--json",
                          "--progress", "none")
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        cls.json = json.loads(done.stdout)
        cls.page_text = cls.read("m.html")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def read(cls, name):
        with open(os.path.join(cls.folder.name, name), encoding="utf-8") as f:
            return f.read()

    @classmethod
    def run_in(cls, *args):
        return subprocess.run([os.path.join(BIN, "medulla-precompute"), *map(str, args)], capture_output=True, text=True,
                              cwd=cls.folder.name, env=CLEAN)

    def test_json_adds_up(self):
        numbers = self.json
        self.assertEqual(numbers["channels"], ["red", "green", "blue"])
        self.assertEqual(numbers["material"]["sigma_ms"], 0.5)
        self.assertEqual((len(numbers["cells"]), len(numbers["far_field"])), (88, 11))
        self.assertEqual(numbers["paths_per_cell"], 320)
        self.assertEqual(numbers["paths"], 88 * 320 + 11 * 8 * 320)
        for c in range(3):
            total, model = 0, 0
            for t, far in enumerate(numbers["far_field"]):
                light = far["channels"][c]
                self.assertAlmostEqual(far["theta_i"], -75 + 15 * t, places=9)
                self.assertAlmostEqual(light["truth"]["scattered"][0], sum(light["truth"][k][0] for k in ("s", "Rs", "sR")))
                cells = [cell["channels"][c] for cell in numbers["cells"][8 * t:8 * t + 8]]
                for kind in light["truth"]:
                    self.assertAlmostEqual(light["truth"][kind][0], sum(x["truth"][kind][0] for x in cells) / 8)
                for lobe in light["model"]:
                    self.assertAlmostEqual(light["model"][lobe], sum(x["model"][lobe] for x in cells) / 8)
                weight = math.cos(math.radians(far["theta_i"])) ** 2 / 6
                total += weight * light["truth"]["scattered"][0]
                model += weight * light["model"]["scattered"]
                for name in ("lobe", "shape", "shape_with_cosine"):
                    distance = light[name]
                    self.assertAlmostEqual(distance["value"], math.sqrt(max(0, distance["square"][0])))
                    self.assertGreater(distance["error"], 0)
            everywhere = numbers["all_directions"][c]
            self.assertAlmostEqual(total, everywhere["truth"]["scattered"][0])
            self.assertAlmostEqual(model, everywhere["model"]["scattered"])
            causes = numbers["causes"][c]["energy"]
            self.assertAlmostEqual(causes["scattered"][0] + causes["absorbed"][0], model - total)
        # More absorption, less scattered light.
        scattered = [light["truth"]["scattered"][0] for light in numbers["all_directions"]]
        self.assertEqual(scattered, sorted(scattered, reverse=True))

    def test_page_is_whole_and_shows_the_numbers(self):
        page = Page(self.page_text)
        self.assertNotRegex(self.page_text, r"https?:|url\(|@import|nan|inf\b")
        self.assertIn("thin <b> & co", page.text)
        for c, table in enumerate(page.tables[:3]):
            light = self.json["all_directions"][c]
            names = {"R": "R", "TT": "TT", "TRT": "TRT", "TRRT and higher": "higher", "scattered": "scattered"}
            rows = {row[0]: row for row in table["rows"][1:]}
            for name, kind in names.items():
                truth, model = light["truth"][kind][0], light["model"].get(kind, 0)
                self.assertAlmostEqual(number(rows[name][1]), truth, delta=5.1e-5)
                self.assertAlmostEqual(number(rows[name][2]), model, delta=5.1e-5)
                self.assertAlmostEqual(number(rows[name][3]), model - truth, delta=5.1e-5)
                self.assertEqual("within noise" in rows[name][4], abs(model - truth) <= 2 * light["truth"][kind][1])
                self.assertRegex(rows[name][1], "± |no noise")
        maps = [table for table in page.tables if table["class"] == "map"]
        self.assertGreaterEqual(len(maps), 6)
        for table in maps:
            self.assertEqual([len(row) for row in table["rows"]], [12] * 9)
        # Columns are theta_i, rows |h|; the green channel.
        for t in range(11):
            for i in range(8):
                lobe = self.json["cells"][8 * t + i]["channels"][1]["lobe"]
                text = maps[0]["rows"][1 + i][1 + t]
                if lobe is None:
                    self.assertEqual(text, "–")
                elif lobe["square"][0] > 2 * lobe["square"][1]:
                    self.assertAlmostEqual(number(text.split("±")[0]), lobe["value"], delta=0.0051)
                else:
                    self.assertIn("noise", text)
        self.assertEqual(self.page_text.count("<svg"), 3 + 4 * 5)

    def test_the_same_bytes_for_any_number_of_threads(self):
        args = ["--fibre", "m.json", "--paths", 320, "--progress", "none"]
        done = self.run_in(*args, "--threads", 2, "--error-map", "two.html", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout), self.json)
        self.assertEqual(self.read("two.html"), self.page_text)
        done = self.run_in(*args, "--seed", 2, "--error-map", "/dev/stdout")
        self.assertEqual(done.returncode, 0)
        self.assertNotEqual(done.stdout, self.page_text)
        self.assertTrue(done.stdout.startswith("<!doctype html>") and done.stdout.endswith("</html>\n"))
        self.assertIn("green: scattered", done.stderr)

    def test_white_hair(self):
        with open(os.path.join(self.folder.name, "hair.json"), "w") as f:
            json.dump({"kappa": 0, "sigma_ca": 0.2}, f)
        done = self.run_in("--fibre", "hair.json", "--error-map", "hair.html", "--paths", 160, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        light = json.loads(done.stdout)["all_directions"][0]
        self.assertIsNone(light["lobe"])
        self.assertGreater(light["model"]["TT"], 0.3)
        done = self.run_in("--fibre", "hair.json", "--error-map", "hair.html", "--paths", 160, "--progress", "none")
        self.assertRegex(done.stdout, r"grey: R 0\.\d+ \+- 0\.\d+, model 0\.\d+; next to no scattered light\n")
        self.assertIn("Nothing scatters.", Page(self.read("hair.html")).text)
        # Two curves of scattered light and two of R at 11 inclinations; none of the error of a lobe that is not there.
        self.assertEqual(self.read("hair.html").count("<circle"), 4 * 11)

    def fails(self, status, *args, parts=()):
        before = {name: self.read(name) for name in os.listdir(self.folder.name)}
        done = self.run_in(*args)
        self.assertEqual((done.returncode, done.stdout), (status, ""), (args, done.stderr))
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
        for part in parts:
            self.assertIn(part, done.stderr)
        self.assertEqual({name: self.read(name) for name in os.listdir(self.folder.name)}, before)

    def test_a_signal_ends_it_with_one_line(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            words = ["--fibre", "m.json", "--error-map", "never.html", "--paths", 1000000, "--progress", "plain"]
            with subprocess.Popen([os.path.join(BIN, "medulla-precompute"), *map(str, words)], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True, cwd=self.folder.name, env=CLEAN) as job:
                first = job.stderr.readline()  # of the progress: the work has begun
                job.send_signal(number)
                out, rest = job.communicate()
            self.assertEqual((job.returncode, out), (128 + number, ""))
            self.assertRegex(first, r"^error map: ")
            self.assertEqual(rest.splitlines()[-1], "medulla-precompute: interrupted: no page written")
            self.assertNotIn("never.html", " ".join(os.listdir(self.folder.name)))

    def test_bad_input(self):
        page = ["--error-map", "never.html"]
        self.fails(2, *page, parts=["--error-map", "--fibre"])
        for option in (["-o", "t.h5"], ["--table", "both"], ["--sigma-range", "0:4:5"], ["--g-range", "0:0.6:3"],
                       ["--h-range", "0:1:4"], ["--theta-range", "0:60:3"], ["--absorption-range", "0:2:3"],
                       ["--scene", "m.json"], ["--dry-run"], ["--bins", "72"], ["--method", "mc"],
                       ["--target-error", "0.01"], ["--time-budget", "9"], ["--resume"], ["--shard", "1/2"],
                       ["--compression", "none"]):
            self.fails(2, "--fibre", "mouse", *page, *option, parts=[option[0].replace("-o", "--output"), "--error-map"])
        for option in (["--paths", "0"], ["--paths", "many"], ["--seed", "-1"], ["--threads", "-1"]):
            self.fails(2, "--fibre", "mouse", *page, *option, parts=[option[0], "expected", "found"])
        self.fails(1, "--fibre", "lion", *page, parts=["--fibre", "bobcat", "lion"])
        self.fails(1, "--fibre", ".", *page, parts=["."])
        self.fails(1, "--fibre", "m.json", "--error-map", "m.json", parts=["m.json", "input"])
        self.fails(1, "--fibre", "mouse", "--error-map", "none/x.html", parts=["none"])
        for field, value, parts in (("alpha", 60, ["degrees in (-45, 45)", "60"]), ("beta_m", 120, ["degrees", "120"]),
                                    ("eta", 0.5, ["(1, 10]", "0.5"]), ("sigma_ms", 500, ["optical radius", "50"]),
                                    ("colour", 1, ["no such field"]), ("sigma_ca", "x", ["number"])):
            with open(os.path.join(self.folder.name, "bad.json"), "w") as f:
                json.dump({"preset": "mouse", field: value}, f)
            self.fails(1, "--fibre", "bad.json", *page, parts=["bad.json", "/" + field, *parts])
        with open(os.path.join(self.folder.name, "bad.json"), "w") as f:
            f.write("{")
        self.fails(1, "--fibre", "bad.json", *page, parts=["bad.json", "JSON"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
