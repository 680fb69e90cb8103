#!/usr/bin/python3
"""Where programs write: outputs that are no plain files, streams that are closed, full or slow, file systems that cannot
lock or bring to disk. Nothing but a plain file is ever replaced or removed, and no stream decides over a job.

outputs.py BIN PRELOAD, the library made of preload.c.
"""
import errno
import fcntl
import hashlib
import json
import os
import pty
import resource
import shutil
import signal
import stat
import subprocess
import sys
import threading
import time
import unittest

from support import runs
from support.runs import CLEAN, sanitized

BIN, PRELOAD = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
SMALL = ["--sigma-range", "0:4:2", "--g-range", "0:0.8:2", "--h-range", "0:1:3", "--theta-range", "0:90:3", "--bins", "36",
         "--threads", "1"]
SANITIZED = sanitized(BIN)


def digest(path):
    with open(path, "rb") as f:
        return hashlib.sha256(f.read()).hexdigest()


class Outputs(runs.WithFiles):
    bin, job = BIN, SMALL

    def run_in(self, program, *args, env={}, timeout=120, **options):
        options = dict(dict(stdout=subprocess.PIPE, stderr=subprocess.PIPE), **options)
        return subprocess.run([os.path.join(BIN, program), *map(str, args)], cwd=self.folder.name, timeout=timeout,
                              env=dict(CLEAN, **env), **options)

    def refused(self, program, *args, parts=(), **options):
        done = self.run_in(program, *args, **options)
        err = done.stderr.decode()
        self.assertEqual((done.returncode, done.stdout), (1, b""), (args, err))
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        for part in parts:
            self.assertIn(part, err)

    def commands(self, output):
        """Every command that writes a file."""
        shards = self.path("parts.h5.shards")
        if not os.path.exists(shards):
            self.assertEqual(self.run_in("medulla-precompute", "-o", "parts.h5", *SMALL, "--shard", "1/1").returncode, 0)
        return (["furtable", "compress", "t.h5", "--rank", 2, "--solver", "als", "-o", output],
                ["furtable", "export", "t.furpack", "--format", "cpp", "-o", output],
                ["furtable", "export", "t.furpack", "--format", "glsl", "-o", output],
                ["furtable", "export", "t.h5", "--format", "npy", "-o", output],
                ["furtable", "merge", "parts.h5.shards", "-o", output])

    # --- targets

    def node(self, name, kind, device=0):
        try:
            os.mknod(self.path(name), kind | 0o666, device)
        except PermissionError:
            self.skipTest("no right to make a device node")

    def test_devices(self):
        """A device of its own: as root, the real /dev/null would have been replaced by a file."""
        self.node("null", stat.S_IFCHR, os.makedev(1, 3))
        os.symlink("null", self.path("link"))
        os.symlink("/dev/full", self.path("full"))
        for name in ("null", "link"):
            for args in self.commands(name):
                done = self.run_in(*args)
                self.assertEqual(done.returncode, 0, (args, done.stderr))
            self.refused("medulla-precompute", "-o", name, *SMALL, parts=[name, "plain file", "found a device"])
        for args in self.commands("full"):
            self.refused(*args, parts=["full", "No space left on device"])
        self.assertTrue(stat.S_ISCHR(os.stat(self.path("null")).st_mode))
        self.assertTrue(os.path.islink(self.path("link")) and os.path.islink(self.path("full")))

    def test_what_is_refused_before_work(self):
        self.node("block", stat.S_IFBLK, os.makedev(7, 250))
        os.mkdir(self.path("folder"))
        os.symlink("folder", self.path("to_folder"))
        os.mkfifo(self.path("pipe"))
        os.symlink("loop", self.path("loop"))
        before = sorted(os.listdir(self.folder.name))
        for name, part in (("block", "block device"), ("folder", "folder"), ("to_folder", "folder"), ("folder/", "folder"),
                           ("folder/.", "folder"), ("..", "folder"), ("new/", "/"), ("pipe", "no reader"),
                           ("none/x", "No such file"), ("t.h5/x", "Not a directory"), ("loop", "symbolic links")):
            for args in (*self.commands(name), ["medulla-precompute", *SMALL, "-o", name]):
                self.refused(*args, parts=[name, part if args[0] == "furtable" else ""])
        self.assertEqual(sorted(set(os.listdir(self.folder.name)) - {"parts.h5.shards"}), before)

    def test_pipes(self):
        expected = {}
        for k, args in enumerate(self.commands("plain")):
            self.assertEqual(self.run_in(*args).returncode, 0)
            expected[k] = digest(self.path("plain"))
        os.mkfifo(self.path("pipe"))
        for k, args in enumerate(self.commands("pipe")):
            got = []

            def reader():
                with open(self.path("pipe"), "rb") as f:
                    got.append(f.read())
            thread = threading.Thread(target=reader)
            thread.start()
            self.assertEqual(self.run_in(*args).returncode, 0, args)
            thread.join()
            self.assertEqual(hashlib.sha256(got[0]).hexdigest(), expected[k])
        self.assertTrue(stat.S_ISFIFO(os.stat(self.path("pipe")).st_mode))
        # A pipe whose reader goes away is an error of one line, no signal.
        reader = subprocess.Popen(["sh", "-c", "exec <pipe; exec sleep 0.01"], cwd=self.folder.name)
        self.refused("furtable", "compress", "t.h5", "--rank", 8, "-o", "pipe", parts=["pipe", "Broken pipe"])
        reader.wait()

    def test_standard_output_as_output(self):
        """All of it is the product then; what is printed goes to standard error. >> appends."""
        for args in self.commands("/dev/stdout"):
            plain = self.run_in(*args[:-1], "plain")
            self.assertEqual(plain.returncode, 0, plain.stderr)
            for name in ("/dev/stdout", "/proc/self/fd/1", "/dev/fd/1"):
                done = self.run_in(*args[:-1], name)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(hashlib.sha256(done.stdout).hexdigest(), digest(self.path("plain")), args)
            with open(self.path("log"), "wb") as f:
                f.write(b"before")
            with open(self.path("log"), "ab") as f:
                self.assertEqual(self.run_in(*args[:-1], "/dev/stdout", stdout=f).returncode, 0)
            with open(self.path("log"), "rb") as f:
                got = f.read()
            self.assertEqual((got[:6], hashlib.sha256(got[6:]).hexdigest()), (b"before", digest(self.path("plain"))))
            self.refused(*args[:-1], "/dev/stderr", parts=["/dev/stderr", "standard error"])
            self.refused(*args[:-1], "/dev/stdin", parts=["/dev/stdin"], stdin=subprocess.PIPE, input=None)
        self.refused("medulla-precompute", "-o", "/dev/stdout", *SMALL, parts=["/dev/stdout", "plain file", "pipe"])

    def test_links_are_followed(self):
        os.mkdir(self.path("far"))
        os.symlink("far/real", self.path("link"))
        os.symlink("link", self.path("link2"))
        for round in range(2):  # to nothing yet, then to a file
            for args in self.commands("link2"):
                self.assertEqual(self.run_in(*args).returncode, 0)
            self.assertEqual(self.run_in("medulla-precompute", "-o", "link2", *SMALL).returncode, 0)
            self.assertTrue(os.path.islink(self.path("link")) and os.path.islink(self.path("link2")))
            self.assertTrue(stat.S_ISREG(os.lstat(self.path("far/real")).st_mode))
            self.assertEqual(os.listdir(self.path("far")), ["real"])

    def test_slices_beside_the_output(self):
        """A folder of slices that is a link, that holds what is not ours, or that is no folder."""
        expected = digest(self.path("t.h5"))
        os.mkdir(self.path("elsewhere"))
        os.symlink("elsewhere", self.path("a.h5.shards"))
        os.mkdir(self.path("b.h5.shards"))
        os.mkfifo(self.path("b.h5.shards/tables.h5.tmp-host-1-1"))
        with open(self.path("b.h5.shards/notes.txt"), "w") as f:
            f.write("mine")
        for name, kept in (("a.h5", []), ("b.h5", ["notes.txt", "tables.h5.tmp-host-1-1"])):
            done = self.run_in("medulla-precompute", "-o", name, *SMALL, "--progress", "none")
            self.assertEqual((done.returncode, done.stderr), (0, b""))
            self.assertEqual(digest(self.path(name)), expected)
            self.assertEqual(sorted(os.listdir(self.path(name + ".shards"))), kept)
        with open(self.path("c.h5.shards"), "w") as f:
            f.write("mine")
        self.refused("medulla-precompute", "-o", "c.h5", *SMALL, parts=["c.h5.shards", "folder"])
        os.mkdir(self.path("d.h5.shards"))
        for name in ("azimuthal-s0000-g0000.shard", "configuration.json"):
            if os.path.exists(self.path("d.h5.shards/" + name)):  # of the run before
                os.remove(self.path("d.h5.shards/" + name))
            os.mkfifo(self.path("d.h5.shards/" + name))
            self.refused("medulla-precompute", "-o", "d.h5", *SMALL, "--resume", parts=["d.h5.shards/" + name, "pipe"])
            self.assertTrue(stat.S_ISFIFO(os.stat(self.path("d.h5.shards/" + name)).st_mode))
            os.remove(self.path("d.h5.shards/" + name))

    def test_no_input_is_the_output(self):
        with open(self.path("scene.json"), "w") as f:
            json.dump({"materials": [{"preset": "cat"}]}, f)
        os.link(self.path("t.h5"), self.path("hard.h5"))
        os.symlink("t.h5", self.path("soft.h5"))
        before = digest(self.path("t.h5")), digest(self.path("scene.json"))
        for output in ("t.h5", "./t.h5", "hard.h5", "soft.h5"):
            self.refused("furtable", "compress", "t.h5", "--rank", 2, "-o", output, parts=[output])
            self.refused("furtable", "merge", "t.h5", "-o", output, parts=[output])
            self.refused("furtable", "export", "t.h5", "--format", "npy", "-o", output, parts=[output])
        self.refused("medulla-precompute", "--scene", "scene.json", "-o", "scene.json", parts=["scene.json"])
        self.assertEqual((digest(self.path("t.h5")), digest(self.path("scene.json"))), before)

    def test_inputs_that_are_no_plain_files(self):
        """Refused at once: to open a pipe would wait for its writer."""
        os.mkfifo(self.path("pipe"))
        os.mkdir(self.path("folder"))
        bcsdf = ["bcsdf", "--theta-i", 1, "--theta-r", 1, "--phi", 1, "--far"]
        for name, part in (("pipe", "pipe"), ("folder", "folder"), ("/dev/zero", "device"), ("none", "No such file")):
            for args in (["info"], ["verify"], ["compress"], ["diff", "t.h5"], ["diff", "default"],
                          ["export", "--format", "npy", "-o", "x"], ["plot", "-o", "x.svg"], [*bcsdf, "--material"],
                          [*bcsdf, "--preset", "cat", "--pack"]):
                self.refused("furtable", *args, name, parts=[name, part], timeout=10)
            self.refused("medulla-precompute", "-o", "new.h5", "--scene", name, parts=[name, part], timeout=10)

    def test_long_names(self):
        for size in (240, 247, 248, 249, 255):
            name = "n" * (size - 3) + ".h5"
            for args in self.commands(name):
                done = self.run_in(*args)
                self.assertEqual(done.returncode, 0, (size, done.stderr))
                os.remove(self.path(name))
            if size + len(".shards") <= 255:
                self.assertEqual(self.run_in("medulla-precompute", "-o", name, *SMALL).returncode, 0)
                self.assertEqual(self.run_in("furtable", "info", name).returncode, 0)
            else:
                self.refused("medulla-precompute", "-o", name, *SMALL, parts=["at most 255 bytes", f"found {size + 7}"])
        for args in (*self.commands("n" * 256), ["medulla-precompute", *SMALL, "-o", "n" * 256]):
            self.refused(*args, parts=["name"])
        self.assertEqual([n for n in os.listdir(self.folder.name) if ".tmp" in n], [])

    def test_without_rights(self):
        """As nobody, since root may write everywhere."""
        if os.geteuid() != 0 or not shutil.which("setpriv"):
            self.skipTest("needs root and setpriv, to be somebody else")
        os.chmod(self.folder.name, 0o755)
        commands = self.commands("x")
        os.makedirs(self.path("closed/inner"))
        os.makedirs(self.path("open"))
        with open(self.path("open/protected"), "w") as f:
            f.write("mine")
        os.chmod(self.path("open/protected"), 0o444)
        os.chmod(self.path("open"), 0o777)
        os.chmod(self.path("closed"), 0o755)
        nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
        for output in ("closed/x", "open/protected"):
            for args in (*commands, ["medulla-precompute", *SMALL, "-o", "x"]):
                args = [*nobody, os.path.join(BIN, args[0]), *map(str, args[1:-1]), output]
                done = subprocess.run(args, cwd=self.folder.name, capture_output=True, text=True, env=CLEAN)
                self.assertEqual((done.returncode, done.stdout), (1, ""), done.stderr)
                self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
                self.assertIn(output + ": cannot be written: Permission denied", done.stderr)
        with open(self.path("open/protected")) as f:
            self.assertEqual(f.read(), "mine")

    # --- streams

    def closed(self, *streams):
        return dict(preexec_fn=lambda: [os.close(s) for s in streams])

    def silent_pipe(self):
        """A pipe that is full already, and that nobody reads."""
        read, write = os.pipe()
        fcntl.fcntl(write, fcntl.F_SETFL, os.O_NONBLOCK)
        try:
            while True:
                os.write(write, b"x" * 4096)
        except BlockingIOError:
            fcntl.fcntl(write, fcntl.F_SETFL, 0)
        return read, write

    def broken_pipe(self):
        read, write = os.pipe()
        os.close(read)
        return write

    def bad_streams(self, number):
        """What may be wrong with standard output (1) or error (2), as options of subprocess."""
        name = {1: "stdout", 2: "stderr"}[number]
        full = open("/dev/full", "wb")
        read, write = self.silent_pipe()
        terminal, side = pty.openpty()
        os.close(terminal)  # hung up
        self.addCleanup(full.close)
        for fd in (read, write, side):
            self.addCleanup(os.close, fd)
        broken = self.broken_pipe()
        self.addCleanup(os.close, broken)
        return [("closed", self.closed(number)), ("all closed", self.closed(0, 1, 2)), ("full", {name: full}),
                ("broken", {name: broken}), ("silent", {name: write}), ("hung up", {name: side})]

    def test_messages_never_decide(self):
        """Progress, messages and errors that nobody takes: the same file, the same status."""
        expected = digest(self.path("t.h5"))
        for stream in (1, 2):
            for kind, options in self.bad_streams(stream):
                for progress in ("plain", "bar", "none"):
                    done = self.run_in("medulla-precompute", "-o", "new.h5", *SMALL, "--progress", progress, **options)
                    self.assertEqual(done.returncode, 0, (stream, kind, progress, done.stderr))
                    self.assertEqual(digest(self.path("new.h5")), expected, (stream, kind))
                    os.remove(self.path("new.h5"))
                for args in self.commands("new"):
                    self.assertEqual(self.run_in(*args, **options).returncode, 0, (stream, kind, args))
                    os.remove(self.path("new"))
                if stream == 2 or kind == "all closed":
                    self.assertEqual(self.run_in("furtable", "info", "none", **options).returncode, 1, kind)
                    self.assertEqual(self.run_in("furtable", "melt", **options).returncode, 2, kind)
        self.assertEqual([n for n in os.listdir(self.folder.name) if ".tmp" in n or "new" in n], [])

    def test_a_product_on_standard_output_is_whole_or_status_1(self):
        where = ["--sigma", 1, "--g", 0.3]
        products = (["furtable", "query", "t.h5", "--table", "azimuthal", *where, "--h", 0.5, "--csv"],
                    ["furtable", "query", "t.h5", "--table", "longitudinal", *where, "--theta", 5],
                    ["furtable", "info", "t.h5"], ["furtable", "info", "t.h5", "--json"], ["furtable", "verify", "t.h5"],
                    ["furtable", "diff", "t.h5", "t.furpack"], ["furtable", "presets"], ["furtable", "--help"],
                    ["furtable", "compress", "t.h5", "--rank", 2, "--solver", "als", "--json"],
                    ["furtable", "merge", "t.h5", "-o", "m.h5", "--json"], ["medulla-precompute", "--dry-run", *SMALL],
                    ["medulla-precompute", "-o", "new.h5", *SMALL, "--progress", "none", "--json"])
        for kind, options in self.bad_streams(1):
            for args in products if kind not in ("silent", "all closed") else ():  # who waits for a product may be slow
                done = self.run_in(*args, **options)
                self.assertEqual(done.returncode, 1, (kind, args, done.stderr))
                self.assertEqual(len(done.stderr.splitlines()), 1, (kind, args, done.stderr))
                self.assertIn(b"standard output: cannot be written", done.stderr)
        for name in ("new.h5", "m.h5", "t.furpack"):  # the files are there all the same
            self.assertEqual(self.run_in("furtable", "verify", name).returncode, 0)
        # A reader that goes away early, and a stream that does not wait.
        done = subprocess.run(f"{BIN}/furtable query t.h5 --table azimuthal --sigma 1 --g 0.3 --h 0.5 | head -n 1",
                              shell=True, cwd=self.folder.name, capture_output=True)
        self.assertEqual(len(done.stdout.splitlines()), 1)
        read, write = os.pipe()
        fcntl.fcntl(write, fcntl.F_SETFL, os.O_NONBLOCK)
        fcntl.fcntl(write, 1031, 4096)  # F_SETPIPE_SZ: smaller than the product
        child = subprocess.Popen([BIN + "/furtable", "query", "t.h5", "--table", "azimuthal", "--sigma", "1", "--g", "0.3",
                                  "--h", "0.5", "--bins", "7200", "--csv"], stdout=write, cwd=self.folder.name)
        os.close(write)
        time.sleep(0.3)
        with os.fdopen(read, "rb") as f:
            self.assertEqual(len(f.read().splitlines()), 7201)
        self.assertEqual(child.wait(), 0)

    def test_closed_streams_are_no_files_of_ours(self):
        """The lowest free number goes to the next file that is opened: messages would be written into it."""
        for closed in ((0,), (1,), (2,), (0, 1), (1, 2), (0, 1, 2)):
            self.assertEqual(self.run_in("medulla-precompute", "-o", "new.h5", *SMALL, **self.closed(*closed)).returncode, 0)
            self.assertEqual(digest(self.path("new.h5")), digest(self.path("t.h5")), closed)
            self.assertFalse(os.path.exists(self.path("new.h5.shards")))

    def test_interrupts_with_bad_streams(self):
        for kind, options in self.bad_streams(2):
            options = dict(dict(stdout=subprocess.DEVNULL), **options)
            child = subprocess.Popen([BIN + "/medulla-precompute", "-o", self.path("long.h5"), "--sigma-range", "900:900",
                                      "--g-range", "0.9:0.9", "--table", "azimuthal", "--method", "analog", "--paths",
                                      "1000000000"], env=CLEAN, **options)
            time.sleep(0.5)
            child.send_signal(signal.SIGINT)
            time.sleep(0.2)
            child.send_signal(signal.SIGINT)
            self.assertEqual(child.wait(timeout=30), 130, kind)
            shutil.rmtree(self.path("long.h5.shards"))

    def test_file_size_limit_is_no_signal(self):
        limit = lambda: (signal.signal(signal.SIGXFSZ, signal.SIG_DFL), resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)))
        for args in self.commands("new"):
            self.refused(*args, parts=["new", "File too large"], preexec_fn=limit, restore_signals=False)

    # --- file systems

    def fake(self, **errors):
        return dict(env=dict({"LD_PRELOAD": PRELOAD}, **{name: str(value) for name, value in errors.items()}))

    @unittest.skipIf(SANITIZED, "a sanitizer must be the first library")
    def test_file_systems_that_cannot(self):
        """fsync of a folder on CIFS, sshfs, vboxsf, DrvFs; flock on NFS without its lock service, Lustre, FUSE."""
        cannot = (errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTTY)
        for value in cannot:
            for options in (self.fake(FAKE_FSYNC_DIR=value), self.fake(FAKE_FSYNC_DIR=value, FAKE_FSYNC=value)):
                for args in (*self.commands("new"), ["medulla-precompute", *SMALL, "-o", "new", "--progress", "none"]):
                    done = self.run_in(*args, **options)
                    self.assertEqual((done.returncode, done.stderr), (0, b""), (value, args))
                    os.remove(self.path("new"))
        for value in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL):
            options = self.fake(FAKE_FLOCK=value)
            for args in (["info", "t.h5"], ["verify", "t.h5"], ["diff", "t.h5", "t.furpack"], *self.commands("new")):
                args = args if args[0] == "furtable" else ["furtable", *args]
                done = self.run_in(*args, **options)
                self.assertEqual((done.returncode, done.stderr), (0, b""), (value, args))
            done = self.run_in("medulla-precompute", *SMALL, "-o", "new.h5", "--progress", "none", **options)
            self.assertEqual((done.returncode, len(done.stderr.splitlines())), (0, 1), done.stderr)
            self.assertIn(b"no locks", done.stderr)

    @unittest.skipIf(SANITIZED, "a sanitizer must be the first library")
    def test_what_was_lost_is_said(self):
        for value in (errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.EINTR):
            for option in ("FAKE_FSYNC", "FAKE_FSYNC_DIR"):
                for args in (*self.commands("new"), ["medulla-precompute", *SMALL, "-o", "new", "--progress", "none"]):
                    self.refused(*args, parts=["brought to disk", os.strerror(value)], **self.fake(**{option: value}))
                    shutil.rmtree(self.path("new.shards"), ignore_errors=True)
        self.assertEqual([n for n in os.listdir(self.folder.name) if ".tmp" in n], [])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
