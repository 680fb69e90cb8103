#!/usr/bin/python3
"""medulla-precompute --fibre, furtable compress, info and verify of it; interruptions and bad input. bake.py BIN"""
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from support.runs import CLEAN

BIN = os.path.abspath(sys.argv.pop(1))
QUICK = ["--paths", "2000", "--bins", "32", "--progress", "none"]


class Bake(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = tempfile.TemporaryDirectory()
        cls.folder = cls.made.name
        cls.run_program("medulla-precompute", "--fibre", "raccoon", "-o", "r.h5", *QUICK)
        cls.run_program("furtable", "compress", "r.h5", "--rank", "8")

    @classmethod
    def tearDownClass(cls):
        cls.made.cleanup()

    @classmethod
    def run_program(cls, program, *args, status=0):
        done = subprocess.run([os.path.join(BIN, program), *args], cwd=cls.folder, env=CLEAN, capture_output=True, text=True)
        assert done.returncode == status, (args, done.returncode, done.stdout, done.stderr)
        return done

    def refused(self, expected, program, *args, status=1):
        before = sorted(os.listdir(self.folder))
        done = self.run_program(program, *args, status=status)
        self.assertIn(expected, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertEqual(sorted(os.listdir(self.folder)), before)

    def path(self, name):
        return os.path.join(self.folder, name)

    def material(self, name, **fields):
        with open(self.path(name), "w") as f:
            json.dump(fields, f)

    def test_files_say_what_they_are(self):
        light = json.loads(self.run_program("furtable", "info", "r.h5", "--json").stdout)
        self.assertEqual(light["kind"], "light of a fibre")
        self.assertEqual(light["material"]["kappa"], 0.65)
        baked = json.loads(self.run_program("furtable", "info", "r.furpack", "--json").stdout)
        self.assertEqual(baked["kind"], "baked material")
        self.assertEqual(baked["material"], light["material"])
        self.assertEqual(baked["functions"], 8)
        self.assertEqual(baked["bytes"], os.path.getsize(self.path("r.furpack")))
        self.assertLess(baked["relative_l2"]["median"], 0.2)  # of 2000 paths a node
        self.assertGreater(baked["relative_l2"]["median"], 0)
        self.assertIn("baked material", self.run_program("furtable", "info", "r.furpack").stdout)
        for name in ("r.h5", "r.furpack"):
            self.assertIn("ok", self.run_program("furtable", "verify", name).stdout)

    def test_equal_jobs_write_equal_bytes(self):
        self.run_program("medulla-precompute", "--fibre", "raccoon", "-o", "again.h5", "--threads", "1", *QUICK)
        self.run_program("furtable", "compress", "again.h5", "-o", "again.furpack", "--rank", "8")

        def digest(name):
            with open(self.path(name), "rb") as f:
                return hashlib.sha256(f.read()).hexdigest()

        self.assertEqual(digest("again.h5"), digest("r.h5"))

    def test_interrupted_and_resumed(self):
        args = ["--fibre", "raccoon", "-o", "i.h5", "--paths", "40000", "--bins", "32", "--progress", "none"]
        job = subprocess.Popen([os.path.join(BIN, "medulla-precompute"), *args], cwd=self.folder, env=CLEAN,
                               stderr=subprocess.PIPE, text=True)
        time.sleep(2)
        job.send_signal(signal.SIGINT)
        message = job.communicate()[1]
        if job.returncode == 0:
            self.skipTest("too fast to interrupt")
        self.assertEqual(job.returncode, 128 + signal.SIGINT, message)
        self.assertIn("continue with --resume", message)
        self.assertFalse(os.path.exists(self.path("i.h5")))
        if not os.path.exists(self.path("i.h5.partial")):
            return  # the second of grace was not enough: nothing was done yet
        self.refused("has cells of an earlier run", "medulla-precompute", *args)
        other = [*args[:5], "50000", *args[6:], "--resume"]
        self.refused("paths: expected 50000, found 40000", "medulla-precompute", *other)
        done = self.run_program("medulla-precompute", *args, "--resume", "--json")
        self.assertGreater(json.loads(done.stdout)["kept_before"], 0)
        self.assertFalse(os.path.exists(self.path("i.h5.partial")))

    def test_bad_input(self):
        self.material("unknown.json", preset="raccoon", kapa=0.5)
        self.refused("unknown.json: /kapa: no such field", "medulla-precompute", "--fibre", "unknown.json")
        self.material("hair.json", preset="raccoon", kappa=0)
        self.refused("hair.json: /kappa: expected a medulla", "medulla-precompute", "--fibre", "hair.json")
        self.material("tilted.json", preset="raccoon", alpha=60)
        self.refused("tilted.json: /alpha: expected degrees in [-45, 45]", "medulla-precompute", "--fibre", "tilted.json")
        self.refused("found 'badger'", "medulla-precompute", "--fibre", "badger")
        self.refused("--table", "medulla-precompute", "--fibre", "raccoon", "--table", "both", status=2)
        self.refused("--bins: expected a multiple of 8", "medulla-precompute", "--fibre", "raccoon", "--bins", "30", status=2)
        self.refused("--rank: expected a multiple of 4", "furtable", "compress", "r.h5", "--rank", "9", "-o", "x", status=2)
        self.refused("--max-bytes: expected at least", "furtable", "compress", "r.h5", "--max-bytes", "100", "-o", "x")
        self.refused("found a baked material", "furtable", "query", "r.furpack", "--table", "azimuthal", "--sigma", "1",
                     "--g", "0.1", "--h", "0")
        self.refused("found 'medulla fibre'", "furtable", "plot", "r.h5", "-o", "x.svg")
        with open(self.path("r.furpack"), "rb") as f:
            good = f.read()
        for bad, expected in ((good[:8] + b"\x07" + good[9:], "expected a baked material of version 1, found version 7"),
                              (good[:-1], "its size is not"), (good[:-1] + b"?", "its checksum does not match")):
            with open(self.path("bad.furpack"), "wb") as f:
                f.write(bad)
            self.refused(expected, "furtable", "info", "bad.furpack")


if __name__ == "__main__":
    unittest.main()
