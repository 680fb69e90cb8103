#!/usr/bin/python3
"""Files with false contents and correct checksums: each is refused with one line, before memory is allocated for it.

hostile.py BIN. Prints their number. tests/mutate.cpp damages files at random; these are deliberate: sizes, shapes, order of
axes, versions, invalid energies, compressions that expand without end, JSON nested deeper than the stack.
"""
import hashlib
import json
import os
import resource
import struct
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy

from support.runs import sanitized

BIN = os.path.abspath(sys.argv.pop(1))
AXES = ["--sigma-range", "0:4:3", "--g-range", "0:0.6:3", "--h-range", "0:1:3", "--theta-range", "0:80:3", "--bins", "36"]
MEMORY = 3 << 30  # address space of the programs and their libraries, plus what these files may allocate
if sanitized(BIN):
    MEMORY = None  # a sanitizer maps terabytes


def run(program, *args, memory=None):
    limit = (lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory))) if memory else None
    done = subprocess.run([os.path.join(BIN, program), *map(str, args)], capture_output=True, text=True, timeout=60,
                          preexec_fn=limit)
    return done.returncode, done.stdout, done.stderr


def contents_hash(f):
    """docs/formats.md"""
    digest = hashlib.sha256()
    for table, axes in (("azimuthal", ["sigma", "g", "h", "phi"]),
                        ("longitudinal", ["sigma", "g", "theta_i", "side", "theta_r"])):
        if table not in f:
            continue
        digest.update(table.encode() + b"\0")
        for name in [*axes, "lobe", "energy", "energy_error", "standard_error", "mean_length"]:
            values = f[table][name][()]
            digest.update(name.encode() + b"\0" + struct.pack("<Q", values.size))
            digest.update(values.astype("<f4" if name == "lobe" else "<f8").tobytes())
    return digest.hexdigest()


def pack_checksum(data):
    value = 0xcbf29ce484222325
    for i, byte in enumerate(data):
        value = ((value ^ (0 if 24 <= i < 32 else byte)) * 0x100000001b3) & 0xffffffffffffffff
    return value


def sealed(pack):
    pack[16:24] = struct.pack("<Q", len(pack))
    pack[24:32] = struct.pack("<Q", pack_checksum(pack))
    return bytes(pack)


class Hostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = staticmethod(lambda name: os.path.join(cls.folder.name, name))
        # Without compression, so that h5py can change it with any HDF5 library.
        assert run("medulla-precompute", "-o", cls.path("good.h5"), *AXES, "--method", "analog", "--paths", 300,
                   "--compression", "none", "--progress", "none")[0] == 0
        assert run("furtable", "compress", cls.path("good.h5"), "--rank", 2, "--solver", "als", "-o",
                   cls.path("good.furpack"))[0] == 0
        with open(cls.path("good.h5"), "rb") as f:
            cls.good = f.read()
        with open(cls.path("good.furpack"), "rb") as f:
            cls.pack = f.read()

    count = 0

    @classmethod
    def tearDownClass(cls):
        print(f"{Hostile.count} false files, each refused")
        cls.folder.cleanup()

    def refused(self, file, *parts, commands=("info", "verify")):
        Hostile.count += 1
        for command in commands:
            code, out, err = run("furtable", command, file, memory=MEMORY)
            self.assertEqual((code, out), (1, ""), (command, parts, err))
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            for part in (os.path.basename(file), *parts):
                self.assertIn(part, err)

    def false_file(self, change, *parts, seal=True):
        """A tables file after `change`, with a matching SHA-256, is refused with a line that contains `parts`."""
        file = self.path("false.h5")
        with open(file, "wb") as f:
            f.write(self.good)
        with h5py.File(file, "r+", libver=("v110", "v110")) as f:
            change(f)
            if seal:
                f.attrs["sha256"] = numpy.bytes_(contents_hash(f))
        self.refused(file, *parts)

    def replace(self, f, name, **options):
        """Another dataset under a name."""
        del f[name]
        f.create_dataset(name, **options)

    def test_the_good_file_is_read(self):
        file = self.path("same.h5")
        with open(file, "wb") as f:
            f.write(self.good)
        with h5py.File(file, "r+", libver=("v110", "v110")) as f:
            f.attrs["sha256"] = numpy.bytes_(contents_hash(f))
        for other in (file, self.path("good.furpack")):
            self.assertEqual(run("furtable", "verify", other, memory=MEMORY)[0], 0)

    def test_numbers_that_are_none(self):
        def put(name, value, at=0):
            def change(f):
                values = f[name][()]
                values.flat[at] = value
                f[name][()] = values
            return change
        for table in ("azimuthal", "longitudinal"):
            for name in ("lobe", "energy", "energy_error", "standard_error", "mean_length"):
                self.false_file(put(f"{table}/{name}", float("nan")), f"/{table}/{name}", "finite")
                self.false_file(put(f"{table}/{name}", -1), f"/{table}", "[0, 1]" if name == "energy" else ">= 0", "found -1")
            for name in ("lobe", "energy", "standard_error"):
                self.false_file(put(f"{table}/{name}", float("inf")), f"/{table}/{name}", "finite")
            self.false_file(put(f"{table}/lobe", 3), f"/{table}", "integral 1")
            self.false_file(put(f"{table}/energy", 0.999, at=-1), f"/{table}", "expected energy")
            self.false_file(put(f"{table}/energy", 17, at=-1), f"/{table}",
                            "expected an energy in [0, 1]" if table == "azimuthal" else "expected energy", "found 17")

    def test_axes_out_of_order(self):
        def values(name, change):
            def apply(f):
                f[name][()] = change(f[name][()])
            return apply
        self.false_file(values("azimuthal/sigma", lambda x: x[::-1]), "/azimuthal/sigma", "increasing")
        self.false_file(values("azimuthal/g", lambda x: [x[0], x[0], x[2]]), "/azimuthal/g", "increasing")
        self.false_file(values("azimuthal/g", lambda x: [x[0], x[1], 1.0]), "/azimuthal/g", "found 1")
        self.false_file(values("azimuthal/h", lambda x: [x[0], x[1], float("nan")]), "/azimuthal/h", "finite")
        self.false_file(values("azimuthal/phi", lambda x: x + 0.01), "/azimuthal/phi", "centres")
        self.false_file(values("longitudinal/side", lambda x: [0, 0.5]), "/longitudinal/side")
        self.false_file(values("longitudinal/theta_i", lambda x: x + 1), "/longitudinal/theta_i")

        def swap(f):  # the lobe's axes in another order, each size right for the other
            lobe = f["azimuthal/lobe"][()].transpose(3, 1, 2, 0)
            self.replace(f, "azimuthal/lobe", data=lobe, chunks=(1, 1, 3, 3))
        self.false_file(swap, "/azimuthal/lobe", "3 x 3 x 3 x 36")

    def test_sizes_shapes_and_kinds(self):
        def other(name, **options):
            return lambda f: self.replace(f, name, **options)
        energy = "azimuthal/energy"
        self.false_file(other(energy, shape=(3, 3, 3), dtype="f8"), energy, "chunks", seal=False)
        self.false_file(other(energy, data=numpy.zeros((3, 3, 3), int), chunks=(1, 1, 3)), energy, "floating-point", seal=False)
        self.false_file(other(energy, data=numpy.zeros((3, 3, 4)), chunks=(1, 1, 4)), energy, "3 x 3 x 4", seal=False)
        self.false_file(other(energy, data=1.0), energy, "array", seal=False)
        self.false_file(other(energy, data=numpy.zeros((3, 3, 3)), maxshape=(99, 99, 99), chunks=(50, 50, 50)), energy, "chunks",
                 seal=False)
        self.false_file(other("azimuthal/sigma", shape=(1 << 40,), chunks=(1 << 20,), dtype="f8"), "sigma", "4096", seal=False)
        self.false_file(other(energy, data=numpy.zeros((3, 3, 3)), chunks=(1, 1, 3), compression="lzf"), energy, "filter 32000",
                 seal=False)
        self.false_file(lambda f: f.__delitem__(energy), energy, "found none", seal=False)
        self.false_file(lambda f: (f.__delitem__("azimuthal"), f.__delitem__("longitudinal")), "/azimuthal", seal=False)
        self.false_file(lambda f: f.attrs.__setitem__("format_version", 99), "version", "99", seal=False)
        self.false_file(lambda f: f.attrs.__setitem__("format", numpy.bytes_("other")), "format", seal=False)
        self.false_file(lambda f: f.attrs.__delitem__("sha256"), "sha256", seal=False)
        self.false_file(lambda f: f.attrs.__setitem__("sha256", numpy.bytes_("0" * 64)), "SHA-256", seal=False)
        self.false_file(lambda f: f.attrs.__setitem__("program", "x" * 65537), "program", "65536 bytes", seal=False)
        self.false_file(lambda f: f["azimuthal"].attrs.__setitem__("seed", 1.5), "seed", seal=False)

    def test_declared_but_not_there(self):
        """Axes of 4096 values each: 6.9e10 numbers, of which the file has none."""
        def change(f):
            for name in ("sigma", "g", "h"):
                self.replace(f, f"azimuthal/{name}", data=numpy.linspace(0, 0.9, 1000), chunks=(1000,))
            for name in ("energy", "energy_error", "standard_error", "mean_length"):
                self.replace(f, f"azimuthal/{name}", shape=(1000, 1000, 1000), chunks=(1, 1, 1000), dtype="f8")
            self.replace(f, "azimuthal/lobe", shape=(1000, 1000, 1000, 36), chunks=(1, 1, 1000, 36), dtype="f4")
        self.false_file(change, "/azimuthal/lobe", "at most 4e9", seal=False)

        def fewer(f):
            change(f)
            for name in ("sigma", "g", "h"):
                self.replace(f, f"azimuthal/{name}", data=numpy.linspace(0, 0.9, 450), chunks=(450,))
            self.replace(f, "azimuthal/lobe", shape=(450, 450, 450, 36), chunks=(1, 1, 450, 36), dtype="f4")
        self.false_file(fewer, "/azimuthal/lobe", "found 0 bytes", seal=False)

    def test_compressions_that_multiply(self):
        """gzip within gzip within gzip: 7 KB that would expand by a factor of 1000 three times."""
        def change(f):
            shape = f["azimuthal/energy"].shape
            del f["azimuthal/energy"]
            plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            plist.set_chunk((1, 1, 3))
            for _ in range(3):
                plist.set_deflate(9)
            space = h5py.h5s.create_simple(shape)
            h5py.h5d.create(f.id, b"azimuthal/energy", h5py.h5t.IEEE_F64LE, space, plist)
            f["azimuthal/energy"][()] = 0.5
        self.false_file(change, "/azimuthal/energy", "compression", seal=False)

    def test_packs(self):
        def false_pack(*parts, offset=None, value=b"", text=None, commands=("info", "verify")):
            pack = bytearray(self.pack)
            if text is not None:
                pack[36:44] = struct.pack("<II", len(pack), len(text))
                pack += text
            if offset is not None:
                pack[offset:offset + len(value)] = value
            with open(self.path("false.furpack"), "wb") as f:
                f.write(sealed(pack))
            self.refused(self.path("false.furpack"), *parts, commands=commands)

        whole = struct.Struct("<I").pack
        table = struct.unpack_from("<I", self.pack, 32)[0]
        scales = struct.unpack_from("<I", self.pack, table + 20)[0]
        axes = table + 104
        false_pack("version", offset=8, value=whole(2))
        false_pack("kind, rank", offset=table + 4, value=whole(0))
        false_pack("outside the pack", offset=axes + 16, value=whole(0xfffffff0))
        false_pack("outside the pack", offset=36, value=whole(0xfffffff0))
        false_pack("scale", offset=scales, value=struct.pack("<f", float("nan")))
        false_pack("scale", offset=scales, value=struct.pack("<f", 3e38))
        # The runtime does not use node counts, but programs evaluate one lobe per node.
        for axis, nodes in ((0, 0xffffffff), (3, 0xffffffff), (3, 0)):
            false_pack("nodes", offset=axes + 32 * axis + 4, value=whole(nodes))
        # Numbers that contradict the error that the pack states: shares of energy above 1 or below 0, and lobes with an odd
        # part four times too large.
        count, = struct.unpack_from("<I", self.pack, 12)
        kinds = {struct.unpack_from("<I", self.pack, at)[0]: at for at in range(table, table + 296 * count, 296)}
        numbers = struct.unpack_from("<I", self.pack, kinds[3] + 20)[0]
        ranks = struct.unpack_from("<I", self.pack, kinds[3] + 12)[0]
        shares = struct.unpack_from(f"<{ranks}f", self.pack, numbers)
        for factor in (3, -0.3):
            false_pack("share", offset=numbers, value=struct.pack(f"<{ranks}f", *(factor * x for x in shares)),
                       commands=("verify",))
        for kind in (0, 1, 2):
            even, odd, stride, _, numbers = struct.unpack_from("<5I", self.pack, kinds[kind] + 4)
            first, count = numbers + 4 * ((even + 7) // 8 * 8), stride - (even + 7) // 8 * 8
            larger = [4 * x for x in struct.unpack_from(f"<{count}f", self.pack, first)]
            false_pack("undershoot", offset=first, value=struct.pack(f"<{count}f", *larger), commands=("verify",))
        for text in (b"[" * 500000 + b"]" * 500000, b"{", b"", b'"\xff"'):
            false_pack("provenance", "JSON", text=text, commands=("info",))

    def test_materials(self):
        file = self.path("m.json")
        for text, part in (("[" * 100000, "levels"), ('{"g": "x"}', "number"), ('{"g": 2}', "g"), ('{"eta": 1e999}', ""),
                           ('{"sigma_ma": -1}', "sigma_ma"), ('{"fur": 1}', "fur"), ('{"a\\nb\\u001b[31m": 1}', "a?b?[31m"), ('{"kappa": [' + "1," * 50000 + "1]}", "number"),
                           (" " * (1 << 21), "bytes"), ("", "JSON"), ('{"name": "\xff"}', "JSON")):
            with open(file, "w", encoding="latin-1") as f:
                f.write(text)
            code, out, err = run("furtable", "bcsdf", "--material", file, "--theta-i", 10, "--theta-r", 10, "--phi", 0, "--far",
                                 memory=MEMORY)
            Hostile.count += 1
            self.assertEqual((code, out), (1, ""), (text[:30], err))
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            self.assertLess(len(err), 400)
            self.assertIn("m.json", err)
            self.assertIn(part, err)

    def test_configurations(self):
        folder = self.path("job.h5.shards")
        os.makedirs(folder, exist_ok=True)
        for text in ("[" * 1000000, "{}", "", '{"program": "x", "tables": {"azimuthal": {"axes": {"sigma": ["0x1p0"]}}}}'):
            with open(os.path.join(folder, "configuration.json"), "w") as f:
                f.write(text)
            code, out, err = run("furtable", "merge", folder, "-o", self.path("merged.h5"), memory=MEMORY)
            Hostile.count += 1
            self.assertEqual((code, out), (1, ""), (text[:30], err))
            self.assertEqual(len(err.strip().splitlines()), 1, err)
            self.assertIn("configuration.json", err)
            self.assertFalse(os.path.exists(self.path("merged.h5")))


if __name__ == "__main__":
    unittest.main(verbosity=2)
