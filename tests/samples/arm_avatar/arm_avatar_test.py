"""samples/arm_avatar: the folder is whole, finds its own libraries, draws the walking avatar on the
emulated core, and streams it.

    arm_avatar_test.py BUILD EMULATOR...

The folder is moved after it was made; nothing but the C library comes from outside.
"""
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[3]
BUILD, EMULATOR = sys.argv[1], sys.argv[2:]
SIZE = 128


def alpha_of(path):
    """The alpha channel of an 8-bit RGBA PNG, row by row; filters after the PNG specification,
    section 9."""
    data, position, packed = path.read_bytes(), 8, b""
    while position < len(data):
        length, kind = struct.unpack(">I4s", data[position:position + 8])
        body = data[position + 8:position + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            seen = (width, height, depth, colour)
            assert seen == (SIZE, SIZE, 8, 6), seen
        packed += body if kind == b"IDAT" else b""
        position += 12 + length
    raw, stride, above, rows = zlib.decompress(packed), 4 * SIZE, bytearray(4 * SIZE), []
    for y in range(SIZE):
        start = y * (stride + 1)
        kind, row = raw[start], bytearray(raw[start + 1:start + 1 + stride])
        for i in range(stride):
            left, up, corner = row[i - 4] if i >= 4 else 0, above[i], above[i - 4] if i >= 4 else 0
            nearest = min((left, up, corner), key=lambda value: abs(left + up - corner - value))
            row[i] = (row[i] + (0, left, up, (left + up) // 2, nearest)[kind]) & 255
        rows.append(row[3::4])
        above = row
    return rows


class ArmAvatar(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.work = tempfile.TemporaryDirectory()
        made, cls.folder = pathlib.Path(cls.work.name, "made"), pathlib.Path(cls.work.name, "moved")
        made.mkdir()
        subprocess.run([ROOT / "samples/arm_avatar/bundle", BUILD, made], check=True)
        shutil.move(made, cls.folder)

    @classmethod
    def tearDownClass(cls):
        cls.work.cleanup()

    def test_holds_all_that_the_board_does_not_have(self):
        for name in [
                "figurine", "person.fgn", "body-128.fgn", "walk.fgn", "README.md", "LICENSE",
                "lib/libstdc++.so.6", "lib/libXNNPACK.so.0.20241108"
        ]:
            self.assertTrue((self.folder / name).is_file(), name)
        tags = subprocess.run(["readelf", "-d", self.folder / "figurine"], capture_output=True,
                              text=True, check=True).stdout
        self.assertRegex(tags, r"\(RPATH\).*\[\$ORIGIN/lib\]")
        self.assertIn("glibc 2.", (self.folder / "README.md").read_text(encoding="utf-8"))

    def test_its_readmes_command_draws_a_walker(self):
        page = (self.folder / "README.md").read_text(encoding="utf-8")
        command = next(
            line.split() for line in page.splitlines() if line.startswith("    ./figurine"))
        command[command.index("512x512")] = f"{SIZE}x{SIZE}"
        run = subprocess.run([*EMULATOR, *command, "--frames", "0:2"], cwd=self.folder,
                             capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 0, run.stderr)
        pictures = [alpha_of(self.folder / f"walk_{frame:04d}.png") for frame in (0, 1)]
        self.assertNotEqual(*pictures)
        for rows in pictures:
            covered = sum(value > 127 for row in rows for value in row)
            tall = sum(any(value > 127 for value in row) for row in rows)
            self.assertTrue(0.03 < covered / SIZE**2 < 0.5 and tall > SIZE / 2,
                            f"{covered} pixels in {tall} rows are no walker")
            self.assertFalse(any(row[0] > 127 or row[-1] > 127 for row in rows),
                             "something touches the picture's sides")

    def test_streams_the_walker_live(self):
        page = (self.folder / "README.md").read_text(encoding="utf-8")
        command = next(
            line.split() for line in page.splitlines() if line.startswith("    ./figurine live"))
        for word, instead in {"512x512": "64x64", "30": "1", "-": "live.y4m"}.items():
            command[command.index(word)] = instead
        run = subprocess.run([*EMULATOR, *command, "--frames", "3", "--json", "live.json"],
                             cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 0, run.stderr)
        said = json.loads((self.folder / "live.json").read_text(encoding="utf-8"))
        stream = (self.folder / "live.y4m").read_bytes()
        head, frame = stream.index(b"\n") + 1, 6 + 64 * 64 * 3 // 2
        self.assertEqual(len(stream) - head, said["shown_frames"] * frame)
        self.assertEqual(said["shown_frames"] + said["dropped_frames"], 3)
        self.assertGreaterEqual(said["shown_frames"], 2, "a second for each is plenty")
        self.assertNotEqual(stream[head:head + frame], stream[-frame:])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
