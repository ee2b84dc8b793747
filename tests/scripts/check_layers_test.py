"""Each rule of scripts/check_layers, broken once in an otherwise sound tree, must be caught and
named; the sound tree must pass."""
import pathlib
import runpy
import subprocess
import sys
import tempfile
import unittest

CHECKER = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check_layers"

SOUND = {
    "formats/include/figurine/pose.h": "#include <array>\n",
    "formats/src/check.cpp": "#include <cstdio>\n",
    "formats/src/package/package.cpp":
        '#include <flatbuffers/verifier.h>\n#include <xxhash.h>\n#include "figurine/pose.h"\n',
    "formats/writer/package_writer.h": '#include "figurine/pose.h"\n',
    "samples/inspect/main.cpp":
        '#include <iostream>\n#include "ports/host/files.h"\n#include "figurine/pose.h"\n',
    "runtime/include/figurine/renderer.h": '#include "figurine/pose.h"\n',
    "runtime/src/nn/unet.cpp": (
        '#include <xnnpack.h>\n#include "runtime/src/kernels/blend.h"\n'
        '// throws nothing; "try {" in a comment is no try\n'),
    "runtime/src/kernels/blend.h": "#include <stdint.h>\n",
    "runtime/src/splat/rasterizer.cpp":
        '#include "figurine/frame.h"\n#include "runtime/src/kernels/blend.h"\n',
    "runtime/include/figurine/frame.h": '#include "figurine/pose.h"\n',
    "runtime/include/figurine/isa.h": "#include <cstdint>\n",
    "runtime/src/renderer.cpp":
        '#include "figurine/renderer.h"\n#include "runtime/src/nn/unet.cpp"\n',
    "samples/common/scene.h": '#include <glm/glm.hpp>\n',
    "ports/host/files.h": '#include <sys/mman.h>\n#include "figurine/pose.h"\n',
    "ports/media/png.h":
        '#include <png.h>\n#include "ports/host/files.h"\n#include "figurine/pose.h"\n',
    "ports/camera/device.h": '#include "ports/media/png.h"\n#include "figurine/renderer.h"\n',
    "ports/camera/device.cpp": '#include "ports/camera/device.h"\n',
    "samples/figurine/main.cpp": (
        '#include <CLI/CLI.hpp>\n#include "figurine/renderer.h"\n'
        '#include "ports/camera/device.h"\n'),
    "toolchain/model/unet.cpp": (
        '#include <torch/torch.h>\n#include "formats/writer/package_writer.h"\n'
        'void f() { try { throw 1; } catch (int) {} }\n'),
    "toolchain/capture/render.cpp": (
        '#include <embree4/rtcore.h>\n#include <jpeglib.h>\n'
        '#include "toolchain/body/skin.h"\n'),
    "toolchain/body/skin.h": '#include "toolchain/error.h"\n',
    "toolchain/error.h": "#include <stdexcept>\n",
    "toolchain/model/unet.h": '#include <Eigen/Dense>\n',
    "toolchain/verify/parity.cpp": '#include "figurine/renderer.h"\n',
    "toolchain/cli/main.cpp": '#include <CLI/CLI.hpp>\n#include "toolchain/model/unet.h"\n',
    "tests/runtime/renderer_test.cpp": (
        '#include <gtest/gtest.h>\n#include "figurine/renderer.h"\n'
        '#include "formats/writer/package_writer.h"\n'),
}

BREACHES = [  # (file, its text, words that the report must hold)
    ("formats/src/a.cpp", '#include "figurine/renderer.h"\n', "formats may not use runtime"),
    ("formats/src/a.cpp", '#include "formats/writer/package_writer.h"\n',
     "formats may not use formats/writer"),
    ("formats/src/a.cpp", '#include "ports/host/files.h"\n', "formats may not use ports"),
    ("formats/src/a.cpp", '#include <png.h>\n', "png.h: only in"),
    ("formats/include/figurine/a.h", '#include <flatbuffers/flatbuffers.h>\n',
     "flatbuffers.h: only in"),
    ("formats/include/figurine/a.h", '#include "package_generated.h"\n',
     "package_generated.h: only in"),
    ("formats/include/figurine/a.h", '#include <xxhash.h>\n', "xxhash.h: only in"),
    ("formats/writer/a.cpp", '#include <fstream>\n', "fstream: formats/writer has no files"),
    ("formats/writer/a.cpp", 'void f() {\n  throw 1;\n}\n', "formats/writer/a.cpp:2: throws"),
    ("runtime/src/a.cpp", '#include "formats/writer/package_writer.h"\n',
     "runtime may not use formats/writer"),
    ("runtime/src/a.cpp", '#include "ports/host/files.h"\n', "runtime may not use ports"),
    ("runtime/src/a.cpp", '#include "toolchain/model/unet.h"\n', "runtime may not use toolchain"),
    ("runtime/src/a.cpp", '#include "../../toolchain/model/unet.h"\n', "runtime/src/a.cpp:1"),
    ("runtime/src/a.cpp", '#include <torch/torch.h>\n', "torch/torch.h: only in"),
    ("runtime/src/a.cpp", '#include <c10/core/Device.h>\n', "c10/core/Device.h: only in"),
    ("runtime/src/splat/a.cpp", '#include <xnnpack.h>\n', "xnnpack.h: only in runtime/src/nn"),
    ("runtime/src/splat/a.cpp", '#  include <pthreadpool.h>\n',
     "pthreadpool.h: only in runtime/src/base"),
    ("runtime/src/a.cpp", '#include <chrono>\n', "chrono: runtime has no files"),
    ("runtime/src/a.cpp", '#include <iostream>\n', "iostream: runtime has no files"),
    ("runtime/src/a.cpp", '#include <cstdio>\n', "cstdio: runtime has no files"),
    ("runtime/src/a.cpp", '#include <thread>\n', "thread: runtime has no files"),
    ("runtime/src/a.cpp", '#include <sys/stat.h>\n', "sys/stat.h: runtime has no files"),
    ("runtime/src/a.cpp", '#include <stdexcept>\n', "stdexcept: runtime has no files"),
    ("runtime/src/a.cpp", 'void f() {\n  try {\n  } catch (...) {\n  }\n}\n',
     "runtime/src/a.cpp:3: catches"),
    ("runtime/src/a.cpp", '#include <nlohmann/json.hpp>\n', "nlohmann/json.hpp: only in"),
    ("runtime/src/splat/a.cpp", '#include "figurine/renderer.h"\n',
     "an arrow up: runtime/src/splat may not use runtime/include/figurine/renderer.h"),
    ("runtime/src/kernels/a.cpp", '#include "runtime/src/nn/unet.cpp"\n',
     "an arrow up: runtime/src/kernels may not use"),
    ("runtime/src/base/a.h", '#include "../splat/rasterizer.cpp"\n',
     "an arrow up: runtime/src/base may not use"),
    ("runtime/src/splat/a.h", '#include <glm/glm.hpp>\n', "glm/glm.hpp: only in"),
    ("formats/src/a.cpp", '#include <glm/vec3.hpp>\n', "glm/vec3.hpp: only in"),
    ("ports/host/a.cpp", '#include "toolchain/model/unet.h"\n', "ports/host may not use toolchain"),
    ("ports/host/a.cpp", '#include "ports/media/png.h"\n', "ports/host may not use ports/media"),
    ("ports/host/a.cpp", '#include <png.h>\n', "png.h: only in"),
    ("ports/host/a.cpp", '#include "samples/figurine/a.h"\n',
     "samples/figurine/a.h: no such header"),
    ("ports/media/a.cpp", '#include "figurine/renderer.h"\n', "ports/media may not use runtime"),
    ("ports/media/a.cpp", '#include "ports/camera/device.h"\n',
     "ports/media may not use ports/camera"),
    ("ports/window/a.cpp", '#include "ports/camera/device.h"\n',
     "ports/window may not use ports/camera"),
    ("ports/window/a.cpp", '#include <CLI/CLI.hpp>\n', "CLI/CLI.hpp: only in"),
    ("samples/figurine/a.cpp", '#include "toolchain/model/unet.h"\n',
     "samples may not use toolchain"),
    ("samples/common/a.cpp", '#include <SDL.h>\n', "SDL.h: only in ports/sdl"),
    ("samples/emulator/a.cpp", '#include <SDL2/SDL_events.h>\n', "SDL_events.h: only in"),
    ("ports/media/a.cpp", '#include <SDL2/SDL.h>\n', "SDL.h: only in ports/sdl"),
    ("samples/figurine/a.cpp", '#include <imgui.h>\n', "imgui.h: only in samples/emulator"),
    ("ports/window/a.cpp", '#include <backends/imgui_impl_sdl2.h>\n',
     "imgui_impl_sdl2.h: only in"),
    ("samples/common/a.cpp", '#include <CLI/CLI.hpp>\n', "CLI/CLI.hpp: only in"),
    ("samples/figurine/a.cpp", '#include <xnnpack.h>\n', "xnnpack.h: only in runtime/src/nn"),
    ("toolchain/model/a.cpp", '#include "figurine/renderer.h"\n', "toolchain may not use runtime"),
    ("toolchain/model/a.cpp", '#include "runtime/src/kernels/blend.h"\n',
     "toolchain may not use runtime"),
    ("toolchain/model/a.cpp", '#include "samples/figurine/main.cpp"\n',
     "toolchain may not use samples"),
    ("toolchain/model/a.cpp", '#include <embree4/rtcore.h>\n',
     "embree4/rtcore.h: only in toolchain/capture"),
    ("toolchain/model/a.cpp", '#include <png.h>\n', "png.h: only in"),
    ("toolchain/body/a.cpp", '#include "toolchain/model/unet.h"\n',
     "an arrow up: toolchain/body may not use toolchain/model/unet.h"),
    ("toolchain/model/a.h", '#include "../verify/parity.cpp"\n',
     "an arrow up: toolchain/model may not use toolchain/verify"),
    ("toolchain/evaluate/a.cpp", "", "its folder has no row in ROOMS"),
    ("runtime/src/cache/a.cpp", "", "its folder has no row in ROOMS"),
    ("toolchain/model/a.cpp", '#include <CLI/CLI.hpp>\n', "CLI/CLI.hpp: only in"),
    ("toolchain/verify/a.cpp", '#include "samples/figurine/main.cpp"\n',
     "toolchain/verify may not use samples"),
    ("samples/figurine/a.cpp", '#include <gtest/gtest.h>\n', "gtest/gtest.h: only in tests"),
]


def check(files):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            path = pathlib.Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        run = subprocess.run([sys.executable, str(CHECKER), folder], capture_output=True, text=True,
                             check=False)
        return run.returncode, run.stdout


class CheckLayers(unittest.TestCase):
    def test_passes_a_sound_tree(self):
        code, report = check(SOUND)
        self.assertEqual(
            (code, report),
            (0, f"check_layers: {len(SOUND)} files, 0 breaches, no include arrows that point up\n"))

    def test_an_empty_tree_is_a_failure(self):
        self.assertEqual(check({})[0], 1)

    def test_finds_a_loop_in_its_own_table(self):
        find_loop = runpy.run_path(str(CHECKER))["find_loop"]
        self.assertEqual(find_loop({"a": [], "b": ["a", "a/word.h"], "c": ["b", "a"]}), [])
        self.assertEqual(find_loop({"a": ["b"], "b": ["c", "d"], "c": [], "d": ["b"]}),
                         ["b", "d", "b"])

    def test_names_every_breach(self):
        for name, text, words in BREACHES:
            with self.subTest(file=name, text=text):
                code, report = check({**SOUND, name: text})
                self.assertEqual(code, 1, report)
                self.assertIn(words, report)
                self.assertIn(name, report)


if __name__ == "__main__":
    unittest.main()
