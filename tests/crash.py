#!/usr/bin/python3
"""Nothing lost: kill -9 at random moments, full disks, read-only folders, interrupts; after --resume the same SHA-256.

crash.py BIN [test names]. MEDULLA_KILLS and MEDULLA_SIZES set how many kills and sizes of a full disk (40 and 12; the
full check is MEDULLA_KILLS=250 MEDULLA_SIZES=60), MEDULLA_SEED the random moments (1).
"""
import hashlib
import json
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

BIN = os.path.abspath(sys.argv[1])
KILLS = int(os.environ.get("MEDULLA_KILLS", "40"))
SIZES = int(os.environ.get("MEDULLA_SIZES", "12"))
SEED = int(os.environ.get("MEDULLA_SEED", "1"))
INSIDE = "MEDULLA_INSIDE"  # set in the name space that may mount
AXES = ["--sigma-range", "0:4:6", "--g-range", "0:0.6:4", "--h-range", "0:1:3", "--theta-range", "0:80:3", "--bins", "72",
        "--progress", "none"]
SMALL = AXES + ["--method", "analog", "--paths", "1500"]


def clean_environment():
    """Launchers' variables would make a worker of every run."""
    return {k: v for k, v in os.environ.items() if not k.startswith(("SLURM_", "OMPI_", "PMI", "PALS_", "MV2_", "MVP_", "FLUX_", "JSM_", "ALPS_"))}


def sanitized():
    """Built with a sanitizer, whose memory map no emulator gives."""
    with open(os.path.join(BIN, "furtable"), "rb") as f:
        program = f.read()
    return b"__asan_init" in program or b"__tsan_init" in program


def start(program, *words, environment={}, **options):
    return subprocess.Popen([os.path.join(BIN, program), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True, env=dict(clean_environment(), **environment), **options)


def run(program, *words, **options):
    process = start(program, *words, **options)
    out, err = process.communicate()
    return process.returncode, out, err


def sha(path):
    status, out, err = run("furtable", "info", path, "--json")
    assert status == 0, err
    return json.loads(out)["sha256"]


class Nothing(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = lambda name: os.path.join(self.folder.name, name)

    def tearDown(self):
        self.folder.cleanup()

    def solve(self, name, *words, status=0):
        code, out, err = run("medulla-precompute", "-o", self.path(name), *words)
        self.assertEqual(code, status, err)
        return err

    def one_line(self, err, *parts):
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        for part in parts:
            self.assertIn(part, err)

    def reference(self):
        self.solve("reference.h5", *SMALL)
        self.assertEqual(os.listdir(self.folder.name), ["reference.h5"])
        digest = sha(self.path("reference.h5"))
        os.remove(self.path("reference.h5"))
        return digest

    def test_kill_at_any_moment(self):
        rng, expected = random.Random(SEED), self.reference()
        begin = time.time()
        self.solve("t.h5", *SMALL)
        whole = time.time() - begin
        os.remove(self.path("t.h5"))
        kills = finished = kept_after_kill = 0
        while kills < KILLS:
            # Goes on from what the last kill left, or from nothing after a run that was brought to its end.
            words = ["-o", self.path("t.h5"), *SMALL, "--resume", "--threads", rng.choice([1, 2, 3])]
            process = start("medulla-precompute", *words)
            time.sleep(rng.uniform(0, 1.1 * whole) * rng.choice([1, 0.5]))
            process.kill()
            out, err = process.communicate()
            self.assertEqual(err, "")
            if process.returncode == -signal.SIGKILL:
                kills += 1
            else:
                self.assertEqual(process.returncode, 0)
            self.assertLessEqual(set(os.listdir(self.folder.name)), {"t.h5", "t.h5.shards"})
            if os.path.exists(self.path("t.h5")):  # there only if whole
                self.assertEqual(sha(self.path("t.h5")), expected)
                self.solve("t.h5", *SMALL, "--resume")  # clears what the kill left of the folder
                self.assertEqual(os.listdir(self.folder.name), ["t.h5"])
                finished += 1
                os.remove(self.path("t.h5"))
            else:
                shards = self.path("t.h5.shards")
                if os.path.exists(shards):
                    kept_after_kill += any(name.endswith(".shard") for name in os.listdir(shards))
                if rng.random() < 0.3:
                    self.solve("t.h5", *SMALL, "--resume")
                    self.assertEqual(sha(self.path("t.h5")), expected)
                    self.assertEqual(os.listdir(self.folder.name), ["t.h5"])
                    finished += 1
                    os.remove(self.path("t.h5"))
        print(f"{kills} kills, {kept_after_kill} with slices kept; {finished} resumed runs, all of SHA-256 {expected[:16]}..")

    def test_kill_merge_at_any_moment(self):
        rng, expected = random.Random(SEED + 1), self.reference()
        for i in (1, 2):
            self.solve("t.h5", *SMALL, "--shard", f"{i}/2")
        kills = 0
        for _ in range(max(4, KILLS // 10)):
            process = start("furtable", "merge", self.path("t.h5.shards"), "-o", self.path("t.h5"))
            time.sleep(rng.uniform(0, 0.05))
            process.kill()
            process.communicate()
            kills += process.returncode == -signal.SIGKILL
            if os.path.exists(self.path("t.h5")):
                self.assertEqual(sha(self.path("t.h5")), expected)
                os.remove(self.path("t.h5"))
        self.assertEqual(run("furtable", "merge", self.path("t.h5"), "-o", self.path("t.h5"))[0], 0)
        self.assertEqual(sha(self.path("t.h5")), expected)
        print(f"{kills} kills of merge")

    def test_interrupt(self):
        slow = AXES + ["--method", "analog", "--paths", "40000", "--threads", "2"]
        self.solve("whole.h5", *slow)
        expected = sha(self.path("whole.h5"))
        for number, status in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
            process = start("medulla-precompute", "-o", self.path("t.h5"), *slow)
            while not (os.path.isdir(self.path("t.h5.shards")) and
                       any(name.endswith(".shard") for name in os.listdir(self.path("t.h5.shards")))):
                self.assertIsNone(process.poll())
                time.sleep(0.001)
            process.send_signal(number)
            out, err = process.communicate()
            self.assertEqual((process.returncode, out), (status, ""), err)
            self.one_line(err, "interrupted: ", "t.h5.shards", "--resume")
            kept, total = map(int, re.search(r"(\d+) of (\d+) slices kept", err).groups())
            self.assertEqual(total, 48)
            self.assertTrue(0 < kept < 48, err)
            self.assertEqual(sum(n.endswith(".shard") for n in os.listdir(self.path("t.h5.shards"))), kept)
            self.assertEqual([n for n in os.listdir(self.path("t.h5.shards")) if ".tmp" in n], [])
            self.one_line(self.solve("t.h5", *slow, status=1), "--resume", "t.h5.shards")
            self.solve("t.h5", *slow, "--resume")
            self.assertEqual(sha(self.path("t.h5")), expected)
            os.remove(self.path("t.h5"))

    def test_same_contents_for_threads_and_shards(self):
        for method in (["--method", "analog", "--paths", "1500"], ["--method", "auto"]):
            words = AXES + method
            self.solve("t.h5", *words)
            expected = sha(self.path("t.h5"))
            for threads in (1, 2, 3, 8):
                self.solve("u.h5", *words, "--threads", threads)
                self.assertEqual(sha(self.path("u.h5")), expected)
                with open(self.path("t.h5"), "rb") as a, open(self.path("u.h5"), "rb") as b:
                    self.assertEqual(a.read(), b.read())
            for shards in (1, 2, 4):
                workers = [start("medulla-precompute", "-o", self.path(f"n{shards}.h5"), *words, "--shard", f"{i + 1}/{shards}")
                           for i in range(shards)]  # all at once, into one folder
                for worker in workers:
                    out, err = worker.communicate()
                    self.assertEqual((worker.returncode, err), (0, ""))
                name = self.path(f"n{shards}.h5")
                self.assertEqual(run("furtable", "merge", name + ".shards", "-o", name)[0], 0)
                self.assertEqual(sha(name), expected)
                shutil.rmtree(name + ".shards")

    def test_same_contents_on_other_processors(self):
        """docs/robustness.md: glibc takes other code of exp, log, sin where there is no AVX2 and FMA; our own loops choose
        by the processor, which only another one changes: an emulated Nehalem (SSE4.2), where qemu-user is there."""
        plain = dict(GLIBC_TUNABLES="glibc.cpu.hwcaps=-AVX2,-FMA")
        emulator = None if sanitized() else shutil.which("qemu-x86_64")
        small = ["--sigma-range", "0:4:2", "--g-range", "0.3:0.3", "--h-range", "0:1:3", "--theta-range", "0:80:3", "--bins",
                 "36", "--threads", "1", "--progress", "none"]
        for method in (["--method", "analog", "--paths", "3000"], ["--method", "deterministic"]):
            self.solve("fast.h5", *AXES, *method)
            code, out, err = run("medulla-precompute", "-o", self.path("plain.h5"), *AXES, *method, environment=plain)
            self.assertEqual(code, 0, err)
            self.assertEqual(sha(self.path("plain.h5")), sha(self.path("fast.h5")), method)
            if emulator:
                self.solve("fast.h5", *small, *method)
                words = [emulator, "-cpu", "Nehalem", os.path.join(BIN, "medulla-precompute"), "-o", self.path("old.h5")]
                done = subprocess.run([*words, *small, *method], capture_output=True, text=True, env=clean_environment())
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(sha(self.path("old.h5")), sha(self.path("fast.h5")), method)
            os.remove(self.path("fast.h5"))
            os.remove(self.path("plain.h5"))
            if emulator:
                os.remove(self.path("old.h5"))

    def test_what_the_hash_is_made_of(self):
        """docs/formats.md's definition, by another program."""
        import h5py
        self.solve("plain.h5", *SMALL, "--compression", "none")
        digest = hashlib.sha256()
        with h5py.File(self.path("plain.h5")) as f:
            for table, axes in (("azimuthal", ["sigma", "g", "h", "phi"]),
                                ("longitudinal", ["sigma", "g", "theta_i", "side", "theta_r"])):
                digest.update(table.encode() + b"\0")
                for name in [*axes, "lobe", "energy", "energy_error", "standard_error", "mean_length"]:
                    values = f[table][name][()]
                    digest.update(name.encode() + b"\0" + struct.pack("<Q", values.size))
                    digest.update(values.astype("<f4" if name == "lobe" else "<f8").tobytes())
            self.assertEqual(f.attrs["sha256"].decode() if isinstance(f.attrs["sha256"], bytes) else f.attrs["sha256"],
                             digest.hexdigest())
        self.assertEqual(sha(self.path("plain.h5")), digest.hexdigest())
        status, out, err = run("furtable", "info", self.path("plain.h5"))
        self.assertIn(digest.hexdigest(), out)

    def test_interrupt_within_one_long_slice(self):
        """No slice ends for hours: the process still does."""
        process = start("medulla-precompute", "-o", self.path("t.h5"), "--sigma-range", "900:900", "--g-range", "0.9:0.9",
                        "--table", "azimuthal", "--method", "analog", "--paths", 10**9, "--progress", "none")
        time.sleep(0.5)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=60)
        self.assertEqual((process.returncode, out), (143, ""), err)
        self.one_line(err, "interrupted", "--resume")

    def test_output_that_is_a_folder(self):
        os.mkdir(self.path("t.h5"))
        self.one_line(self.solve("t.h5", *SMALL, status=1), "t.h5", "folder")
        self.assertEqual(os.listdir(self.folder.name), ["t.h5"])  # before anything is solved

    def test_file_size_limit(self):
        """EFBIG at every stage: what RLIMIT_FSIZE cuts stands for any write that fails midway."""
        import resource
        expected = self.reference()
        self.solve("t.h5", *SMALL)
        size = os.path.getsize(self.path("t.h5"))
        os.remove(self.path("t.h5"))
        for limit in (0, 1, 100, 1000, 5000, size // 2, size - 1):
            code, out, err = run("medulla-precompute", "-o", self.path("t.h5"), *SMALL, restore_signals=False,
                                 preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
            self.assertEqual(code, 1, err)
            self.one_line(err, self.path("t.h5"), "File too large")
            self.assertFalse(os.path.exists(self.path("t.h5")))
            left = [name for _, _, names in os.walk(self.folder.name) for name in names]
            self.assertEqual([name for name in left if ".tmp" in name], [])
            self.solve("t.h5", *SMALL, "--resume")
            self.assertEqual(sha(self.path("t.h5")), expected)
            self.assertEqual(os.listdir(self.folder.name), ["t.h5"])
            os.remove(self.path("t.h5"))

    def test_full_disk_and_read_only_folder(self):
        """In a name space of its own, where it may mount small file systems."""
        code = subprocess.run(["unshare", "-rm", "true"], capture_output=True).returncode
        if code != 0:
            self.skipTest("no right to mount a small file system (unshare -rm)")
        done = subprocess.run(["unshare", "-rm", sys.executable, os.path.abspath(__file__), BIN, "Disks"],
                              env=dict(os.environ, **{INSIDE: "1"}), capture_output=True, text=True)
        print(done.stdout, end="")
        self.assertEqual(done.returncode, 0, done.stderr)


class Disks(Nothing):
    """Runs inside the name space."""

    def mount(self, options):
        disk = self.path("disk")
        os.makedirs(disk, exist_ok=True)
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "medulla-test", disk], check=True)
        return disk

    def test_sizes(self):
        expected = self.reference()
        self.solve("t.h5", *SMALL)
        size = os.path.getsize(self.path("t.h5"))
        words, full, fitted = ["-o", self.path("disk/t.h5"), *SMALL], 0, 0
        # From nothing to room for everything: shards of a page each, then the file itself beside them.
        room = 56 * 4096 + 2 * size
        for i in range(SIZES):
            pages = 1 + i * (room // 4096) // (SIZES - 1)
            disk = self.mount(f"size={4096 * pages}")
            code, out, err = run("medulla-precompute", *words)
            if code == 0:
                fitted += 1
                self.assertEqual(err, "")
            else:
                full += 1
                self.assertEqual(code, 1)
                self.one_line(err, "disk/t.h5", "No space left on device")
                left = [name for _, _, names in os.walk(disk) for name in names]
                self.assertFalse(os.path.exists(disk + "/t.h5"))
                self.assertEqual([name for name in left if ".tmp" in name], [])
                if "--resume" not in err:
                    self.assertEqual(left, [])
                subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
                code, out, err = run("medulla-precompute", *words, "--resume")
                self.assertEqual((code, err), (0, ""))
            self.assertEqual(sha(disk + "/t.h5"), expected)
            self.assertEqual(os.listdir(disk), ["t.h5"])
            subprocess.run(["umount", disk], check=True)
        print(f"{SIZES} sizes of a disk: {full} too small, {fitted} large enough; SHA-256 {expected[:16]}.. after resume")
        self.assertGreaterEqual(full, SIZES // 3)
        self.assertGreater(fitted, 0)

    def test_merge_and_compress_on_a_full_disk(self):
        self.solve("t.h5", *SMALL, "--shard", "1/1")
        self.solve("u.h5", *SMALL)
        for i in range(6):
            disk = self.mount(f"size={4096 * (1 + 2 * i)}")
            for words in (["merge", self.path("t.h5.shards"), "-o", disk + "/m.h5"],
                          ["compress", self.path("u.h5"), "--rank", 8, "--solver", "als", "-o", disk + "/m.furpack"]):
                code, out, err = run("furtable", *words)
                if code == 0:
                    self.assertEqual(run("furtable", "verify", words[-1])[0], 0)
                    os.remove(words[-1])
                else:
                    self.one_line(err, words[-1], "No space left on device")
                self.assertEqual(os.listdir(disk), [])
            subprocess.run(["umount", disk], check=True)

    def test_read_only(self):
        disk = self.mount("size=64m")
        self.solve("disk/t.h5", *SMALL, "--shard", "1/2")
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        for words in ([], ["--resume"], ["--shard", "2/2"]):
            code, out, err = run("medulla-precompute", "-o", disk + "/t.h5", *SMALL, *words)
            self.assertEqual(code, 1)
            if words:
                self.one_line(err, "disk/t.h5", "Read-only file system")
        code, out, err = run("medulla-precompute", "-o", disk + "/new.h5", *SMALL)
        self.assertEqual(code, 1)
        self.one_line(err, "disk/new.h5", "Read-only file system")
        code, out, err = run("furtable", "merge", disk + "/t.h5.shards", "-o", disk + "/all.h5")
        self.assertEqual(code, 1)
        subprocess.run(["umount", disk], check=True)


for name in [n for n in dir(Nothing) if n.startswith("test_")]:
    setattr(Disks, name, None)  # Disks has the tools of Nothing, not its tests
if not os.environ.get(INSIDE):
    del Disks

if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=2)
