#!/usr/bin/python3
"""What people type and bring who do not know the programs: numbers that are none, launchers of every kind, names that are
no UTF-8, tables that h5py wrote, axes of one node, packs as C++ under any name, another job's slices.

outsiders.py BIN RUNTIME_INCLUDE
"""
import hashlib
import itertools
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import unittest

import h5py
import numpy

from support import runs
from support.runs import CLEAN

BIN, INCLUDE = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
SMALL = ["--sigma-range", "0:4:2", "--g-range", "0:0.8:2", "--h-range", "0:1:3", "--theta-range", "0:90:3", "--bins", "36",
         "--threads", "1", "--progress", "none"]
TABLES = {"azimuthal": ["sigma", "g", "h", "phi"], "longitudinal": ["sigma", "g", "theta_i", "side", "theta_r"]}
VALUES = ["lobe", "energy", "energy_error", "standard_error", "mean_length"]


class Outsiders(runs.WithFiles):
    bin, job = BIN, [*SMALL, "--compression", "none"]

    def run_in(self, program, *args, env={}, timeout=120):
        args = [w if isinstance(w, bytes) else str(w) for w in args]
        done = subprocess.run([os.path.join(BIN, program), *args], cwd=self.folder.name, timeout=timeout, capture_output=True,
                              env=dict(CLEAN, **env))
        return done.returncode, done.stdout, done.stderr

    def good_run(self, *args, **options):
        code, out, err = self.run_in(*args, **options)
        self.assertEqual((code, err), (0, b""), args)
        return out

    def fails(self, status, *args, parts=(), **options):
        code, out, err = self.run_in(*args, **options)
        self.assertEqual((code, out), (status, b""), (args, err))
        self.assertEqual(len(err.strip().splitlines()), 1, err)
        for part in parts:
            self.assertIn(part if isinstance(part, bytes) else part.encode(), err)

    # --- options

    def test_numbers(self):
        """Every numeric option of both programs, by name; nothing runs and nothing is written."""
        query = ["query", "t.h5", "--table", "azimuthal", "--sigma", 1, "--g", 0.3, "--h", 0.5]
        slab = ["query", "t.h5", "--table", "longitudinal", "--sigma", 1, "--g", 0.3, "--theta", 0.5]
        bcsdf = ["bcsdf", "--preset", "cat", "--theta-i", 1, "--theta-r", 1, "--phi", 1]
        compress = ["compress", "t.h5", "-o", "new.furpack"]
        real = {"furtable": [(compress, "--max-error"), (query, "--sigma"), (query, "--g"), (query, "--h"), (slab, "--theta"),
                             (query, "--absorption"), (["verify", "t.furpack"], "--max-undershoot"), ([*bcsdf, "--far"], "--theta-i"),
                             ([*bcsdf, "--far"], "--theta-r"), ([*bcsdf, "--far"], "--phi"), (bcsdf, "--h")],
                "medulla-precompute": [(["-o", "new.h5"], "--target-error"), (["-o", "new.h5"], "--time-budget")]}
        whole = {"furtable": [(compress, "--rank"), (compress, "--max-bytes"), (compress, "--seed"), (compress, "--sweeps"),
                              (query, "--bins")],
                 "medulla-precompute": [(["-o", "new.h5"], option) for option in ("--bins", "--paths", "--seed", "--threads")]}
        ranges = {"medulla-precompute": [(["-o", "new.h5"], f"--{axis}-range") for axis in ("sigma", "g", "h", "theta", "absorption")],
                  "furtable": [(bcsdf, "--h-range")]}
        nonsense = ["nan", "-nan", "inf", "-inf", "NaN", "infinity", "0x10", "0x1p-3", "1,5", "1.5x", "1e", "", " 1", "1 ", "--1",
                    "1e999", "١"]
        for programs, wrong in ((real, nonsense), (whole, [*nonsense, "-1", "1.5", "1e3", "18446744073709551616", "-0x1"]),
                                (ranges, [f"{n}:{m}" for n in nonsense for m in ("1", n)] + ["0:nan", "0:0x1", "0:1:0x3", "0:1:nan",
                                                                                            "0:1:-1", "0:1:2.5", "0:1:3:4", ":"])):
            for program, options in programs.items():
                for args, option in options:
                    args = [w for i, w in enumerate(args) if option not in (w, args[i - 1] if i else None)]
                    for number in wrong:
                        for form in ([option, number], [f"{option}={number}"]):
                            self.fails(2, program, *args, *form, parts=[option])
        for option in ("--max-error", "--max-bytes", "--rank", "--sweeps"):
            for number in ("0", "-1", "-0"):
                self.fails(2, "furtable", *compress, option, number, parts=[option])
        for option in ("--target-error", "--time-budget"):
            for number in ("0", "-1", "-0.0"):
                self.fails(2, "medulla-precompute", option, number, parts=[option])
        self.assertEqual(sorted(os.listdir(self.folder.name)), ["t.furpack", "t.h5"])

    def test_valid_numbers(self):
        self.good_run("furtable", "compress", "t.h5", "--rank", "2", "--solver", "als", "--seed", 2 ** 64 - 1, "-o", "x.furpack")
        self.assertEqual(json.loads(self.good_run("furtable", "info", "x.furpack", "--json"))["provenance"]["seed"], 2 ** 64 - 1)
        for number in ("0.5", "+0.5", "5e-1", ".5"):
            self.good_run("furtable", "query", "t.h5", "--table", "azimuthal", "--sigma", 1, "--g", 0.3, "--h", number)

    def test_empty_arguments_name_their_option(self):
        for args, option in ((["-o", ""], "-o"), (["--output", ""], "--output"), (["--output="], "--output"), (["--scene", ""], "--scene"),
                              (["--scene="], "--scene"), (["--sigma-range="], "--sigma-range"), (["--shard", ""], "--shard")):
            self.fails(2, "medulla-precompute", *args, parts=[option])
        for args, option in ((["info", ""], "number 2"), (["compress", "t.h5", "-o", ""], "-o"), (["compress", "t.h5", "--output="], "--output"),
                              (["export", "t.furpack", "--format", "cpp", "--name=", "-o", "x"], "--name")):
            self.fails(2, "furtable", *args, parts=[option])

    # --- launchers

    def test_ranks(self):
        """Three ranks of each launcher: a share each, and a first line that says so."""
        expected = json.loads(self.good_run("furtable", "info", "t.h5", "--json"))["sha256"]
        step = {"SLURM_JOB_ID": "7", "SLURM_STEP_ID": "0", "SLURM_NTASKS": "64"}
        outer = {"SLURM_JOB_ID": "7", "SLURM_STEP_ID": "0", "SLURM_PROCID": "0", "SLURM_NTASKS": "1"}
        for rank, size, more in (("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", outer), ("PMI_RANK", "PMI_SIZE", outer),
                                 ("PALS_RANKID", "PALS_SIZE", {}), ("PALS_RANKID", "PMI_SIZE", {"PALS_LOCAL_RANKID": "0"}),
                                 ("MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE", {}), ("JSM_NAMESPACE_RANK", "JSM_NAMESPACE_SIZE", {}),
                                 ("FLUX_TASK_RANK", "FLUX_JOB_SIZE", {}), ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS", step),
                                 ("SLURM_PROCID", "SLURM_NTASKS", {}),
                                 ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", {"SLURM_JOB_ID": "7", "SLURM_PROCID": "0",
                                                                                    "SLURM_NTASKS": "8"})):
            for i in range(3):
                env = dict(more, **{rank: str(i), size: "3"})
                code, out, err = self.run_in("medulla-precompute", "-o", "new.h5", *SMALL, "--shard", "auto", env=env)
                self.assertEqual(code, 0, err)
                line = err.decode().splitlines()[0]
                for part in (f"worker {i + 1} of 3", rank, size, "--shard none"):
                    self.assertIn(part, line)
                self.assertEqual(len(err.splitlines()), 1)
            self.good_run("furtable", "merge", "new.h5.shards", "-o", "new.h5")
            self.assertEqual(json.loads(self.good_run("furtable", "info", "new.h5", "--json"))["sha256"], expected, rank)
            os.remove(self.path("new.h5"))
            shutil.rmtree(self.path("new.h5.shards"))

    def test_one_process_alone(self):
        """A batch script, which has SLURM_PROCID too; one rank; and who asks for it."""
        batch = {"SLURM_JOB_ID": "7", "SLURM_PROCID": "0", "SLURM_NTASKS": "16", "SLURM_NNODES": "2"}
        for env, args in ((batch, []), ({"PMI_RANK": "0", "PMI_SIZE": "1"}, []),
                           ({"SLURM_STEP_ID": "4294967290", "SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "1"}, []),
                           ({"PMI_RANK": "2", "PMI_SIZE": "3"}, ["--shard", "none"]), ({"PMIX_RANK": "1"}, ["--shard", "none"])):
            self.good_run("medulla-precompute", "-o", "new.h5", *SMALL, *args, env=env)
            self.good_run("furtable", "verify", "new.h5")
            os.remove(self.path("new.h5"))

    def test_launchers_without_a_size(self):
        for env, parts in (({"PMIX_RANK": "1"}, ["PMIX_RANK", "--shard I/N"]), ({"PMI_RANK": "1"}, ["PMI_RANK", "PMI_SIZE"]),
                           ({"PALS_RANKID": "1", "PALS_LOCAL_SIZE": "4"}, ["PALS_RANKID", "PALS_SIZE"]),
                           ({"SLURM_STEP_ID": "0", "SLURM_PROCID": "1"}, ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS"]),
                           ({"PMI_RANK": "3", "PMI_SIZE": "3"}, ["PMI_RANK", "below 3", "found 3"]),
                           ({"PMI_RANK": "x", "PMI_SIZE": "3"}, ["PMI_RANK", "'x'"]), ({"PMI_RANK": "", "PMI_SIZE": "3"}, ["PMI_RANK", "''"]),
                           ({"PMI_RANK": "0", "PMI_SIZE": "0"}, ["PMI_RANK", "PMI_SIZE"]),
                           ({"PMI_RANK": "0", "PMI_SIZE": "99999999"}, ["PMI_SIZE"]), ({"PMI_RANK": "-1", "PMI_SIZE": "3"}, ["PMI_RANK"])):
            self.fails(2, "medulla-precompute", "-o", "new.h5", *SMALL, env=env, parts=["--shard auto", *parts])
        self.assertEqual(sorted(os.listdir(self.folder.name)), ["t.furpack", "t.h5"])

    # --- another job

    def test_resume_names_the_option_that_differs(self):
        def variant(**changes):
            args = list(SMALL)
            for option, value in changes.items():
                option = "--" + option.replace("_", "-")
                args = [*args, option, value] if option not in args else \
                    [value if i and args[i - 1] == option else w for i, w in enumerate(args)]
            return args
        jobs = {"--bins": variant(bins="40"), "--sigma-range": variant(sigma_range="0:5:2"), "--g-range": variant(g_range="0:0.8:3"),
                "--h-range": variant(h_range="0:0.5:3"), "--theta-range": variant(theta_range="0:80:3"), "--seed": variant(seed="2"),
                "--paths": variant(paths="77"), "--method": variant(method="deterministic"), "--target-error": variant(target_error="0.01"),
                "--time-budget": variant(time_budget="5"), "--table": variant(table="azimuthal"),
                "--absorption-range": variant(absorption_range="0:1:2")}
        found = {"--bins": ["expected 40, found 36"], "--sigma-range": ["0:5:2", "0:4:2"], "--g-range": ["0:0.8:3", "0:0.8:2"],
                 "--theta-range": ["0:80:3", "0:90:3"], "--seed": ["expected 2, found 1"], "--method": ["deterministic", "auto"],
                 "--target-error": ["0.01", "none"], "--absorption-range": ["0:1:2", "none"], "--table": ["azimuthal", "both"]}
        self.good_run("medulla-precompute", "-o", "part.h5", *SMALL, "--shard", "1/2")
        for output in ("t.h5", "part.h5"):
            for option, args in jobs.items():
                named = [o for o in jobs if o != option]
                code, out, err = self.run_in("medulla-precompute", "-o", output, *args, "--resume")
                text = err.decode()
                self.assertEqual((code, out, len(text.splitlines())), (1, b"", 1), text)
                for part in ("another job", output, option + ": expected", *found.get(option, [])):
                    self.assertIn(part, text)
                for other in named:
                    self.assertNotIn(other + ":", text)
                self.assertIsNone(re.search("[0-9a-f]{32}", text), text)
        # Of workers too, and the slices stay.
        self.fails(1, "medulla-precompute", "-o", "part.h5", *jobs["--seed"], "--resume", "--shard", "2/2", parts=["--seed: expected 2, found 1"])
        self.good_run("medulla-precompute", "-o", "part.h5", *SMALL, "--resume")
        # The same range by other nodes.
        scene = {"materials": [{"name": "soft", "eta": 1.6, "kappa": 0.9, "sigma_ms": 1, "g": 0.1}]}
        with open(self.path("scene.json"), "w") as f:
            json.dump(scene, f)
        args = [w if w != "0:0.8:2" else "0:0.8:5" for w in SMALL]
        self.good_run("medulla-precompute", "-o", "s.h5", *args)
        self.fails(1, "medulla-precompute", "-o", "s.h5", *args, "--scene", "scene.json", "--resume", parts=["--g-range: expected"])

    # --- names

    def test_names_are_bytes(self):
        """Latin-1, cut UTF-8, surrogates, control characters; in JSON, \\xHH, of which the bytes can be told again."""
        def bytes_of(text):
            return re.sub(rb"\\(\\|x([0-9a-f]{2}))", lambda m: b"\\" if m[1] == b"\\" else bytes([int(m[2], 16)]), text.encode())
        names = [b"caf\xe9", b"\xe2\x82", b"\xed\xa0\x80", b"\xff\xfe", b"\xc0\xaf", b"\xf5\x80\x80\x80", "grüße €😀".encode(), b"back\\slash",
                 b"back\\xe9", b"a b", b"new\nline", b"tab\tq'\"", b"<&>", b"%41%"]
        for name in names:
            table, pack, merged = name + b".h5", name + b".furpack", name + b"m.h5"
            shutil.copy(self.path("t.h5"), os.path.join(self.folder.name.encode(), table))
            report = json.loads(self.good_run("furtable", "compress", table, "--rank", 2, "--solver", "als", "--json"))
            self.assertEqual(bytes_of(report["output"]), pack)
            for file in (table, pack):
                info = json.loads(self.good_run("furtable", "info", file, "--json"))
                self.assertEqual(bytes_of(info["file"]), file)
                entries = json.loads(self.good_run("furtable", "verify", file, "--json"))
                self.assertEqual([bytes_of(k) for k in entries], [file])
                self.good_run("furtable", "info", file), self.good_run("furtable", "verify", file)
                self.good_run("furtable", "diff", table, file)
            self.assertEqual(bytes_of(info["provenance"]["input"]), table)
            report = json.loads(self.good_run("furtable", "merge", table, "-o", merged, "--json"))
            self.assertEqual(bytes_of(report["output"]), merged)
            new = name + b".new.h5"
            report = json.loads(self.good_run("medulla-precompute", "-o", new, *SMALL, "--json"))
            self.assertEqual(bytes_of(report["output"]), new)
            for extension in (b".svg", b".html", b".png"):
                if extension != b".png" or shutil.which("rsvg-convert"):
                    self.good_run("furtable", "plot", table, pack, "-o", name + extension)
            with open(os.path.join(self.folder.name.encode(), name + b".svg"), "rb") as f:
                import xml.dom.minidom
                xml.dom.minidom.parseString(f.read())
            self.good_run("furtable", "export", pack, "--format", "cpp", "-o", name + b".hpp")
            code, out, err = self.run_in("furtable", "verify", name + b"none", "--json")
            self.assertEqual((code, len(err.splitlines())), (1, 1))
            (key, entry), = json.loads(out).items()
            self.assertEqual(bytes_of(key), name + b"none")
            self.assertIn(name + b"none", bytes_of(entry["error"]))

    # --- tables from elsewhere

    def own(self, name, text, change=lambda f: None):
        """A tables file by docs/formats.md alone: every attribute that is text as `text(f, value)` makes it."""
        digest = hashlib.sha256()
        with h5py.File(self.path("t.h5")) as raw, h5py.File(self.path(name), "w", libver=("v110", "v110")) as f:
            for table, axes in TABLES.items():
                group = f.create_group(table)
                text(group, "method", "somebody's simulation")
                group.attrs["seed"], group.attrs["paths"] = numpy.uint64(0), numpy.uint64(0)
                digest.update(table.encode() + b"\0")
                for n in axes + VALUES:
                    v = raw[table][n][()]
                    group.create_dataset(n, data=v, chunks=(1, 1) + v.shape[2:] if v.ndim > 1 else v.shape)
                    digest.update(n.encode() + b"\0" + struct.pack("<Q", v.size))
                    digest.update(v.astype("<f4" if n == "lobe" else "<f8").tobytes())
            text(f, "format", "medulla tables"), text(f, "program", "my converter 1.0")
            text(f, "configuration", "0" * 64), text(f, "sha256", digest.hexdigest())
            f.attrs["format_version"] = numpy.uint32(2)
            change(f)
        return self.path(name)

    def test_strings_of_hdf5(self):
        def fixed(pad, character_set, spare):
            def text(object, name, value):
                kind = h5py.h5t.C_S1.copy()
                kind.set_size(len(value) + spare)
                kind.set_strpad(pad)
                kind.set_cset(character_set)
                fill = b" " if pad == h5py.h5t.STR_SPACEPAD else b"\0"
                attribute = h5py.h5a.create(object.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
                attribute.write(numpy.array(value.encode().ljust(len(value) + spare, fill), dtype=f"S{len(value) + spare}"), kind)
            return text

        def variable(character_set):
            return lambda o, name, value: o.attrs.create(name, value, dtype=h5py.string_dtype(character_set))
        kinds = [variable("utf-8"), variable("ascii"), lambda o, name, value: o.attrs.__setitem__(name, value),
                 lambda o, name, value: o.attrs.__setitem__(name, numpy.bytes_(value)),
                 lambda o, name, value: o.attrs.create(name, [value], dtype=h5py.string_dtype())]
        for pad, spares in ((h5py.h5t.STR_NULLTERM, (1, 9)), (h5py.h5t.STR_NULLPAD, (0, 1, 9)), (h5py.h5t.STR_SPACEPAD, (0, 1, 9))):
            kinds += [fixed(pad, c, spare) for c in (h5py.h5t.CSET_ASCII, h5py.h5t.CSET_UTF8) for spare in spares]
        for text in kinds:
            file = self.own("own.h5", text)
            self.good_run("furtable", "verify", file)
            info = json.loads(self.good_run("furtable", "info", file, "--json"))
            self.assertEqual((info["program"], info["tables"]["azimuthal"]["method"]), ("my converter 1.0", "somebody's simulation"))
            self.good_run("furtable", "compress", file, "--rank", 2, "--solver", "als")
        print(f"{len(kinds)} kinds of string")
        for change, parts in ((lambda f: f.attrs.__setitem__("program", 3), ["program"]), (lambda f: f.attrs.__setitem__("program", ["a", "b"]), ["program"]),
                              (lambda f: f.attrs.__setitem__("program", h5py.Empty("S10")), ["program"]),
                              (lambda f: f.attrs.__setitem__("format", "other"), ["format", "'other'"]),
                              (lambda f: f.attrs.__setitem__("sha256", "0" * 64), ["SHA-256"]),
                              (lambda f: f["azimuthal"].attrs.__setitem__("seed", -1), ["/azimuthal", "seed", "found -1"])):
            self.fails(1, "furtable", "info", self.own("own.h5", kinds[0], change), parts=["own.h5", *parts])
        # Attributes of ours that somebody else would write as whole numbers or of another size.
        file = self.own("own.h5", kinds[0], lambda f: (f["azimuthal"].attrs.__setitem__("target_error", 1), f.attrs.__setitem__("format_version", numpy.int64(2)),
                                                       f["longitudinal"].attrs.__setitem__("paths", numpy.array([5], ">i2"))))
        self.good_run("furtable", "verify", file)

    def test_degenerate_axes(self):
        """Every file that is written can be read: by every command, of every axis that may be one node or lie at an end of its range."""
        ranges = {"--sigma-range": ["0:0", "2:2", "1e-300:1e-300", "0:1e-6:2", "0:4:3"], "--g-range": ["0:0", "0.95:0.95", "-0.5:0:2"],
                  "--h-range": ["0:0", "1:1", "0:1:2"], "--theta-range": ["0:0", "90:90", "0:90:2"], "--bins": ["720", "8"]}
        every = [dict(zip(ranges, values)) for values in itertools.product(*ranges.values())]
        chosen = every[::11] + [dict(every[0], **{"--bins": bins}) for bins in ("720", "2048", "4096")]
        for k, options in enumerate(chosen):
            args = [w for pair in options.items() for w in pair] + ["--method", "deterministic", "--progress", "none"]
            if k % 5 == 0:
                args += ["--absorption-range", ("0:0", "0:1:2")[k % 2]]
            if k % 4:
                args += ["--compression", ("zstd", "gzip", "none")[k % 3]]
            self.good_run("medulla-precompute", "-o", "new.h5", *args, timeout=600)
            for command in ("info", "verify"):
                self.good_run("furtable", command, "new.h5")
            self.good_run("furtable", "diff", "new.h5", "new.h5")
            self.good_run("furtable", "export", "new.h5", "--format", "npy", "-o", "new.npy")
            self.good_run("furtable", "merge", "new.h5", "-o", "merged.h5")
            code, out, err = self.run_in("furtable", "compress", "new.h5", "--rank", 2, "--solver", "als")
            if code == 0:
                self.good_run("furtable", "info", "new.furpack")
                self.good_run("furtable", "export", "new.furpack", "--format", "glsl", "-o", "new.glsl")
            else:
                self.assertEqual((code, len(err.splitlines())), (1, 1), (args, err))
        print(f"{len(chosen)} of {len(every)} combinations of axes")

    # --- packs as C++

    def test_a_pack_as_cpp_compiles_beside_the_header(self):
        """Under any name that is taken: the runtime's own, keywords, names of its functions; twice, and in two units."""
        compiler = os.environ.get("CXX") or shutil.which("g++") or shutil.which("clang++")
        names = ["mine", "default_pack", "class", "namespace", "auto", "int", "medulla", "Pack", "near", "far", "open_pack", "near_field", "pack", "std"]
        text = '#include "medulla/medulla.hpp"\n'
        for k, name in enumerate(names):
            self.good_run("furtable", "export", "t.furpack", "--format", "cpp", "--name", name, "-o", f"{k}.hpp")
            text += f'#include "{k}.hpp"\n'
        self.good_run("furtable", "export", "default", "--format", "cpp", "--name", "default_pack", "-o", "same.hpp")
        with open(self.path("same.hpp")) as same, open(os.path.join(INCLUDE, "medulla/default_pack.hpp")) as shipped:
            self.assertEqual(same.read(), shipped.read())
        self.good_run("furtable", "export", "t.furpack", "--format", "cpp", "--name", "mine", "-o", "again.hpp")
        self.good_run("furtable", "export", "default", "--format", "cpp", "--name", "mine", "-o", "other.hpp")
        text += '#include "again.hpp"\n'
        use = "".join(f"    if (open_pack({n}_words, {n}_size).status != PackStatus::ok) return {k + 1};\n"
                      for k, n in enumerate(names) if n != "default_pack")
        main = (text + "std::size_t other();\nint main() {\n    using namespace medulla;\n" + use +
                "    return other() == default_pack_size_here() && mine_size != other() ? 0 : 99;\n}\n")
        main = main.replace("int main()", "std::size_t default_pack_size_here();\nint main()")
        # Another pack of the same name in another unit: the linker must not take one for the other.
        unit = ('#include "other.hpp"\n#include "medulla/medulla.hpp"\n#include "same.hpp"\nstd::size_t other() {\n'
                '    return medulla::open_pack(medulla::mine_words, medulla::mine_size).status == medulla::PackStatus::ok ? medulla::mine_size : 0;\n}\n'
                'std::size_t default_pack_size_here() { return medulla::default_pack_size; }\n')
        for file, source in (("main.cpp", main), ("unit.cpp", unit)):
            with open(self.path(file), "w") as f:
                f.write(source)
        for order in (["main.cpp", "unit.cpp"], ["unit.cpp", "main.cpp"]):
            done = subprocess.run([compiler, "-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror", "-I", INCLUDE, *order, "-o", "all"],
                                  cwd=self.folder.name, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr[:2000])
            self.assertEqual(subprocess.run(["./all"], cwd=self.folder.name).returncode, 0)
        for name in ("a__b", "_a", "_A", "a_", "1x", "a-b", "a b", "a::b", "é", "a\n"):
            self.fails(2, "furtable", "export", "t.furpack", "--format", "cpp", "--name", name, "-o", "no.hpp", parts=["--name"])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
