"""Shared by the tests that run the programs: an environment without launchers, sanitizers, and a folder of small files."""
import os
import shutil
import subprocess
import tempfile
import unittest

# Variables of launchers would turn every run into a worker.
LAUNCHERS = ("SLURM_", "OMPI_", "PMI", "PALS_", "MV2_", "MVP_", "FLUX_", "JSM_", "ALPS_")
CLEAN = {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHERS)}


def sanitized(folder):
    """Whether the programs in this folder are built with a sanitizer."""
    with open(os.path.join(folder, "furtable"), "rb") as f:
        program = f.read()
    return b"__asan_init" in program or b"__tsan_init" in program


class WithFiles(unittest.TestCase):
    """Each test has a folder of its own with small t.h5 and t.furpack."""
    bin = None  # folder of the programs
    job = []    # arguments of medulla-precompute

    @classmethod
    def setUpClass(cls):
        cls.made = tempfile.TemporaryDirectory()
        cls.good = os.path.join(cls.made.name, "t.h5")
        for args in (["medulla-precompute", "-o", cls.good, *cls.job],
                     ["furtable", "compress", cls.good, "--rank", "4", "--solver", "als"]):
            done = subprocess.run([os.path.join(cls.bin, args[0]), *args[1:]], capture_output=True, env=CLEAN)
            assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.made.cleanup()

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = lambda name: os.path.join(self.folder.name, name)
        for name in ("t.h5", "t.furpack"):
            shutil.copy(os.path.join(self.made.name, name), self.path(name))

    def tearDown(self):
        self.folder.cleanup()
