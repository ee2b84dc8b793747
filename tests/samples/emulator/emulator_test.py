"""figurine-emulator, driven by a script and photographed: on a display without a screen (Xvfb),
drawn in software, with the shipped packages.

    emulator_test.py EMULATOR
"""
import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[3]
EMULATOR = sys.argv.pop(1)
PACKAGES = ROOT / "samples/packages"
WIDTH, HEIGHT = 1280, 800
BACKGROUND = (219, 224, 230)  # behind figures, by default


def pixels_of(path):
    """The rows of an 8-bit RGB PNG as tuples; filters after the PNG specification, section 9."""
    data, position, packed = path.read_bytes(), 8, b""
    while position < len(data):
        length, kind = struct.unpack(">I4s", data[position:position + 8])
        body = data[position + 8:position + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 2), (depth, colour)
        packed += body if kind == b"IDAT" else b""
        position += 12 + length
    raw, stride = zlib.decompress(packed), 3 * width
    above, rows = bytearray(stride), []
    for y in range(height):
        start = y * (stride + 1)
        kind, row = raw[start], bytearray(raw[start + 1:start + 1 + stride])
        for i in range(stride):
            left, up = row[i - 3] if i >= 3 else 0, above[i]
            corner = above[i - 3] if i >= 3 else 0
            if kind == 4:
                nearest = min((left, up, corner), key=lambda value: abs(left + up - corner - value))
                row[i] = (row[i] + nearest) & 255
            elif kind:
                row[i] = (row[i] + (0, left, up, (left + up) // 2)[kind]) & 255
        rows.append([tuple(row[i:i + 3]) for i in range(0, stride, 3)])
        above = row
    return rows


class Display:
    """Xvfb, with whatever number is free."""

    def __enter__(self):
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x900x24", "-nolisten", "tcp"],
            pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as said:
            self.name = ":" + said.readline().strip()
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()


class Emulator(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def environment(self, **more):
        kept = {name: value for name, value in os.environ.items()
                if name not in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")}
        return {**kept, "SDL_RENDER_DRIVER": "software", "XDG_RUNTIME_DIR": str(self.folder),
                **more}

    def run_script(self, script, *arguments, **environment):
        (self.folder / "script.txt").write_text(script)
        return subprocess.run([EMULATOR, "--script", "script.txt", *arguments], cwd=self.folder,
                              env=self.environment(**environment), capture_output=True, text=True,
                              timeout=300, check=False)

    def state(self, name="state.json"):
        return json.loads((self.folder / name).read_text())

    def messages(self, state, error):
        return [each["text"] for each in state["messages"] if each["error"] == error]

    def test_a_session_is_photographed(self):
        shutil.copy(PACKAGES / "person.fgn", self.folder / "cut.fgn")
        whole = (self.folder / "cut.fgn").read_bytes()
        (self.folder / "cut.fgn").write_bytes(whole[:len(whole) // 2])
        script = f"""
            wait idle
            pause
            seek 0.5
            set fast-blend on
            set averted-above 0.25
            wait measured
            screenshot first.png
            drop cut.fgn
            frames 5
            wait idle
            screenshot broken.png
            drop {ROOT}/samples/samplers/edge.fgn
            frames 5
            wait idle
            seed 7
            wait idle
            seed 7 8 0.5
            wait idle
            undo
            profile a53-board
            drag 100 0
            screenshot board.png
            state state.json
            quit
        """
        with Display() as display:
            done = self.run_script(script, str(PACKAGES / "person.fgn"), str(PACKAGES / "walk.fgn"),
                                   SDL_VIDEODRIVER="x11", DISPLAY=display.name)
        self.assertEqual(done.returncode, 0, done.stderr)
        state = self.state()
        self.assertEqual([each["file"] for each in state["figures"]],
                         [str(PACKAGES / "person.fgn"), "seed 7"])
        self.assertTrue(state["can_redo"])
        errors = self.messages(state, True)
        self.assertEqual(len(errors), 1, errors)
        self.assertIn("cut.fgn", errors[0])
        self.assertEqual(state["profile"], "a53-board")
        self.assertGreater(state["estimated_ms"], state["frame_ms"])
        study = state["study"]["switches"]
        self.assertEqual(len(study), 13)
        self.assertTrue(study["stopped"]["same"])
        self.assertGreater(study["fast-blend"]["error_db"], 45)
        self.assertLess(study["averted-above"]["error_db"], 45)
        pictures = {name: pixels_of(self.folder / name)
                    for name in ("broken.png", "board.png")}  # with a message; with estimates
        for name, picture in pictures.items():
            self.assertEqual((len(picture), len(picture[0])), (HEIGHT, WIDTH), name)
            columns = [x for x in range(WIDTH) if any(row[x] == BACKGROUND for row in picture)]
            rows = [y for y in range(HEIGHT) if BACKGROUND in picture[y]]
            self.assertGreater(len(columns), 400, f"{name}: the picture is there")
            # Somebody stands in the middle, and letters stand at both sides.
            inside = [row[columns[0]:columns[-1]] for row in picture[rows[0]:rows[-1]]]
            shown = sum(pixel != BACKGROUND for row in inside for pixel in row)
            self.assertGreater(shown, 0.04 * len(inside) * len(inside[0]), name)
            for low, high in ((0, columns[0]), (columns[-1], WIDTH)):
                bright = sum(sum(pixel) > 500 for row in picture[:680] for pixel in row[low:high])
                self.assertGreater(bright, 1000, f"{name}: words beside the picture")
        self.assertNotEqual((self.folder / "first.png").read_bytes(),
                            (self.folder / "broken.png").read_bytes(), "the message is seen")

    def test_it_needs_no_display_of_its_own(self):
        done = self.run_script("frames 3\nscreenshot empty.png\nstate state.json\nquit",
                               "--size", "900x600", SDL_VIDEODRIVER="dummy")
        self.assertEqual(done.returncode, 0, done.stderr)
        picture = pixels_of(self.folder / "empty.png")
        self.assertEqual((len(picture), len(picture[0])), (600, 900))
        self.assertEqual(self.state()["figures"], [])

    def test_without_a_display_there_is_one_line(self):
        done = self.run_script("quit", SDL_VIDEODRIVER="x11")
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr,
                         r"\Afigurine-emulator: window: there is no display[^\n]*\n\Z")

    def test_a_wrong_script_is_one_line_and_no_window(self):
        done = self.run_script("play\nfly", SDL_VIDEODRIVER="x11")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr,
                         "figurine-emulator: script.txt: line 2: 'fly' is no command\n")
        done = subprocess.run([EMULATOR, "--letters", "2"], capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode, 2, done.stderr)

    def test_a_signal_ends_it_and_its_recording_is_whole(self):
        (self.folder / "script.txt").write_text("record r.y4m\nwait 60\n")
        running = subprocess.Popen(
            [EMULATOR, "--script", "script.txt", "--profile", "a53-panel"], cwd=self.folder,
            env=self.environment(SDL_VIDEODRIVER="dummy"), stderr=subprocess.PIPE, text=True)
        time.sleep(2)
        running.send_signal(signal.SIGINT)
        said = running.communicate(timeout=60)[1]
        self.assertEqual(running.returncode, -signal.SIGINT, said)
        self.assertEqual(said.count("\n"), 1, said)
        video = (self.folder / "r.y4m").read_bytes()
        header = video.index(b"\n") + 1
        self.assertTrue(video.startswith(b"YUV4MPEG2 W480 H480 F30:1"), video[:header])
        self.assertGreater(len(video), header)
        self.assertEqual((len(video) - header) % (6 + 480 * 480 * 3 // 2), 0)


unittest.main()
