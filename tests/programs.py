#!/usr/bin/python3
"""The programs as a user runs them: words, files, exit statuses, one line per error (docs/formats.md)."""
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

BIN = os.path.abspath(sys.argv.pop(1))
SMALL = ["--sigma-range", "0:4:5", "--g-range", "0:0.6:3", "--h-range", "0:1:4", "--theta-range", "0:60:3",
         "--bins", "72", "--paths", "2000", "--progress", "none"]


def run(program, *words, cwd=None):
    done = subprocess.run([os.path.join(BIN, program), *map(str, words)], capture_output=True, text=True, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


class Programs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = staticmethod(lambda name: os.path.join(cls.folder.name, name))
        status, out, err = run("medulla-precompute", "-o", cls.path("t.h5"), *SMALL)
        assert status == 0 and err == "", err
        status, out, err = run("furtable", "compress", cls.path("t.h5"), "--rank", 8)
        assert status == 0, err

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def fails(self, status, program, *words, names=()):
        code, out, err = run(program, *words, cwd=self.folder.name)
        self.assertEqual(code, status, (words, out, err))
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        self.assertEqual(out, "")
        for name in names:
            self.assertIn(name, err)

    def test_help_and_version(self):
        for program in ("medulla-precompute", "furtable"):
            self.assertEqual(run(program, "--help")[0], 0)
            self.assertRegex(run(program, "--version")[1], r"medulla \d+\.\d+\.\d+")

    def test_wrong_words_are_status_2(self):
        for words in (["--sigma-range", "2:1"], ["--sigma-range", "x"], ["--bins", "7"], ["--bins", "0"],
                      ["--g-range", "0:1"], ["--h-range", "0:2"], ["--theta-range", "0:91"], ["--table", "both!"],
                      ["--paths", "0"], ["--paths", "-5"], ["--nonsense"], ["--method", "magic"], ["--threads", "-1"]):
            self.fails(2, "medulla-precompute", "-o", self.path("never.h5"), *words, names=[words[0]])
            self.assertFalse(os.path.exists(self.path("never.h5")))
        self.fails(2, "furtable")
        self.fails(2, "furtable", "melt", "t.h5")
        self.fails(2, "furtable", "compress", "t.h5", "--rank", 0)
        self.fails(2, "furtable", "query", "t.h5", "--table", "azimuthal", "--sigma", 1, "--g", 0.3)
        self.fails(2, "furtable", "query", "t.h5", "--table", "longitudinal", "--sigma", 1, "--g", 0.3, "--h", 0.1)
        self.fails(2, "furtable", "plot", "t.h5", "-o", "x.jpg")

    def test_unreadable_files_are_status_1(self):
        with open(self.path("text"), "w") as f:
            f.write("this is no table")
        with open(self.path("t.furpack"), "rb") as f:
            pack = bytearray(f.read())
        other = bytes(pack[:8]) + (99).to_bytes(4, "little") + bytes(pack[12:])
        with open(self.path("other.furpack"), "wb") as f:
            f.write(other)
        pack[len(pack) // 2] ^= 4
        with open(self.path("flipped.furpack"), "wb") as f:
            f.write(pack)
        for command in ("info", "verify"):
            self.fails(1, "furtable", command, "missing.h5", names=["missing.h5"])
            self.fails(1, "furtable", command, "text", names=["text"])
            self.fails(1, "furtable", command, "other.furpack", names=["other.furpack", "version"])
            self.fails(1, "furtable", command, "flipped.furpack", names=["flipped.furpack", "checksum"])
            self.fails(1, "furtable", command, self.folder.name)
        self.fails(1, "furtable", "compress", "t.furpack", names=["t.furpack"])
        self.fails(1, "medulla-precompute", "-o", "/nonexistent/t.h5", *SMALL, names=["/nonexistent/t.h5"])

    def test_parameters_outside_the_axes_are_status_1(self):
        for file in ("t.h5", "t.furpack"):
            query = ["query", file, "--table", "azimuthal"]
            self.fails(1, "furtable", *query, "--sigma", 4.5, "--g", 0.3, "--h", 0.1, names=["sigma", "4.5"])
            self.fails(1, "furtable", *query, "--sigma", 1, "--g", 0.7, "--h", 0.1, names=["g", "0.7"])
            self.fails(1, "furtable", *query, "--sigma", 1, "--g", 0.3, "--h", 1.1, names=["h", "1.1"])
            self.fails(1, "furtable", *query, "--sigma", "nan", "--g", 0.3, "--h", 0.5, names=["sigma"])
            self.fails(1, "furtable", "query", file, "--table", "longitudinal", "--sigma", 1, "--g", 0.3, "--theta", 75,
                       names=["theta_i"])

    def test_query_columns_add_up_to_their_energies(self):
        for file in ("t.h5", "t.furpack"):
            code, out, err = run("furtable", "query", self.path(file), "--table", "azimuthal", "--sigma", 1.2, "--g", 0.3,
                                 "--h", -0.5, "--csv")
            self.assertEqual((code, err), (0, ""))
            lines = out.splitlines()
            self.assertEqual(lines[0], "phi,density")
            rows = [tuple(map(float, line.split(","))) for line in lines[1:]]
            self.assertEqual(len(rows), 72)
            energy = sum(d for _, d in rows) * 2 * math.pi / 72
            # Below 1 only by what the pack's dips below zero add; `furtable verify` prints that figure.
            self.assertAlmostEqual(energy / (1 - math.exp(-2.4 * math.sqrt(0.75))), 1, delta=1e-2)
            code, out, err = run("furtable", "query", self.path(file), "--table", "longitudinal", "--sigma", 1.2, "--g", 0.3,
                                 "--theta", 20, "--json")
            lobe = json.loads(out)
            for side in ("back", "forward"):
                self.assertAlmostEqual(sum(lobe[side]) * math.pi / 36, 1, delta=1e-2)
            total = 1 - math.exp(-2.4 / math.cos(math.radians(20)))
            self.assertAlmostEqual(lobe["energy_back"] + lobe["energy_forward"], total, places=5)

    def test_negative_offset_is_the_mirror_image(self):
        lobes = [json.loads(run("furtable", "query", self.path("t.furpack"), "--table", "azimuthal", "--sigma", 1, "--g", 0.3,
                                "--h", h, "--json")[1])["density"] for h in (0.5, -0.5)]
        self.assertEqual(lobes[0], lobes[1][::-1])

    def test_h5py_reads_what_it_can_and_names_the_filter_of_the_rest(self):
        import h5py
        for compression in ("none", "gzip"):
            file = self.path(compression + ".h5")
            self.assertEqual(run("medulla-precompute", "-o", file, *SMALL, "--compression", compression)[0], 0)
            with h5py.File(file) as f:
                lobe = f["azimuthal/lobe"]
                self.assertEqual(lobe.shape, (5, 3, 4, 72))
                self.assertEqual([d.label for d in lobe.dims], ["sigma", "g", "h", "phi"])
                self.assertEqual(list(lobe.dims[0]["sigma"][:]), list(f["azimuthal/sigma"][:]))
                total = lobe[:].sum(axis=-1) * 2 * math.pi / 72
                self.assertLess(abs(total - 1).max(), 1e-5)
                self.assertEqual(f["longitudinal/lobe"].shape, (5, 3, 3, 2, 36))
                self.assertEqual(f["azimuthal"].attrs["seed"], 1)
        with h5py.File(self.path("t.h5")) as f:
            self.assertEqual(f["azimuthal/lobe"].shape, (5, 3, 4, 72))
            filters = f["azimuthal/lobe"].id.get_create_plist()
            self.assertIn(32015, [filters.get_filter(i)[0] for i in range(filters.get_nfilters())])

    def test_same_seed_same_file_for_any_number_of_threads(self):
        files = []
        for threads in (1, 2, 5):
            file = self.path(f"threads{threads}.h5")
            self.assertEqual(run("medulla-precompute", "-o", file, *SMALL, "--threads", threads)[0], 0)
            with open(file, "rb") as f:
                files.append(f.read())
        self.assertTrue(files[0] == files[1] == files[2])

    def test_one_node_axes(self):
        file = self.path("one.h5")
        self.assertEqual(run("medulla-precompute", "-o", file, "--sigma-range", "2:2:1", "--g-range", "0.5:0.5", "--h-range",
                             "0.2:0.2:1", "--theta-range", "30:30", "--bins", 36, "--paths", 500, "--progress", "none")[0], 0)
        self.assertEqual(run("furtable", "verify", file)[0], 0)
        self.assertEqual(run("furtable", "compress", file, "--rank", 1)[0], 0)
        for other in (file, self.path("one.furpack")):
            status, out, err = run("furtable", "query", other, "--table", "azimuthal", "--sigma", 2, "--g", 0.5, "--h", 0.2)
            self.assertEqual(status, 0, err)
            self.fails(1, "furtable", "query", other, "--table", "azimuthal", "--sigma", 2.1, "--g", 0.5, "--h", 0.2)

    def test_info_verify_diff_plot_export(self):
        for file in ("t.h5", "t.furpack"):
            self.assertEqual(run("furtable", "verify", self.path(file))[0], 0)
            info = json.loads(run("furtable", "info", self.path(file), "--json")[1])
            self.assertIn("azimuthal", info["tables"])
        diff = json.loads(run("furtable", "diff", self.path("t.h5"), self.path("t.furpack"), "--json")[1])
        errors = diff["errors"]
        for error in errors.values():  # nothing is claimed below the table's noise
            self.assertGreater(error["noise"], 0)
            self.assertGreaterEqual(error["relative_l2_with_noise"], max(error["noise"], error["relative_l2"]))
        verified = json.loads(run("furtable", "verify", self.path("t.furpack"), "--json")[1])[self.path("t.furpack")]
        self.assertEqual(verified["degeneracy"], diff["degeneracy"])
        self.assertEqual(verified["energy_error"], max(e["energy_error"] for e in errors.values()))
        self.assertEqual(set(errors), {"azimuthal", "longitudinal back", "longitudinal forward"})
        same = json.loads(run("furtable", "diff", self.path("t.h5"), self.path("t.h5"), "--json")[1])["errors"]
        self.assertEqual(max(e["relative_l2"] for e in same.values()), 0)
        for extension in ("svg", "html"):
            picture = self.path("p." + extension)
            self.assertEqual(run("furtable", "plot", self.path("t.h5"), self.path("t.furpack"), "-o", picture)[0], 0)
            with open(picture) as f:
                self.assertIn("<polyline", f.read())
        import numpy
        status, out, err = run("furtable", "export", self.path("t.h5"), "--format", "npy", "-o", self.path("a.npy"))
        self.assertEqual(status, 0, err)
        self.assertEqual(numpy.load(self.path("a.npy")).shape, (5, 3, 4, 72))
        self.assertEqual(run("furtable", "export", self.path("t.furpack"), "--format", "cpp", "-o", self.path("p.hpp"))[0], 0)

    def test_no_temporary_file_is_left(self):
        self.assertEqual([name for name in os.listdir(self.folder.name) if ".tmp" in name], [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
