"""An avatar's network by figurine, ONNX Runtime and LibTorch: the same answers, then the times.

    scripts/setup peers
    scripts/run cmake --preset dev -DFIGURINE_PEERS=ON
    scripts/run cmake --build --preset dev --target network_peers
    scripts/run python3 scripts/experiments/network_peers.py [--build FOLDER] [--output FILE]

`network_peers export` writes the shipped person's layers and weights; from those this writes two
models of the same network with python3-onnx, in float and in integers (QDQ: int8 weights per
channel, int8 values per tensor, scales and zero points of the package; the input, int16 in
figurine, stays in float, and so does the head's result). `network_peers run` compares what all of
them say on the maps of recorded poses, and then times them by turns on one thread, in wall and in
CPU time. Without the toolchain's build LibTorch is left out, and the file says so. (Debian's
python3-onnx says "Schema error" many times when it is loaded; nothing is wrong.)

Writes docs/results/network_peers.json, and prints a line a peer.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy
import onnx
from onnx import TensorProto, helper, numpy_helper

import results

PACKAGES = pathlib.Path("samples/packages")
SCENE = [PACKAGES / "person.fgn", PACKAGES / "body-128.fgn", PACKAGES / "walk.fgn"]
OPSET = 13  # per-channel QuantizeLinear and its kin
IR_VERSION = 8


class Graph:
    """The nodes of one model. Values are called v0 (the input), v1, ...: as in figurine."""

    def __init__(self, folder):
        self.network = json.loads((folder / "network.json").read_text(encoding="utf-8"))
        self.blob = (folder / "network.bin").read_bytes()
        self.nodes, self.constants = [], []

    def array(self, place, dtype):
        begin, count = place
        return numpy.frombuffer(self.blob, dtype, count, begin)

    def constant(self, name, array):
        self.constants.append(numpy_helper.from_array(numpy.ascontiguousarray(array), name))
        return name

    def node(self, op, inputs, output, **attributes):
        self.nodes.append(helper.make_node(op, inputs, [output], **attributes))
        return output

    def kernel(self, layer, key, dtype):
        """[out, kernel, kernel, in] as [out, in, kernel, kernel]."""
        size = layer["kernel"]
        flat = self.array(layer[key], dtype).reshape(layer["out_channels"], size, size, -1)
        return flat.transpose(0, 3, 1, 2)

    def upsample(self, value, output, number):
        scales = self.constant(f"scales{number}", numpy.array([1, 1, 2, 2], numpy.float32))
        return self.node("Resize", [value, "", scales], output, mode="linear",
                         coordinate_transformation_mode="half_pixel")

    def convolution(self, layer, inputs, output):
        pad = layer["kernel"] // 2
        plain = f"{output}_sum" if layer["relu"] else output
        self.node("Conv", inputs, plain, pads=[pad] * 4)
        return self.node("Relu", [plain], output) if layer["relu"] else plain

    def moved(self, layer, inputs, output, number):
        """Of an operator without weights."""
        if layer["op"] == "max_pool":
            return self.node("MaxPool", inputs[:1], output, kernel_shape=[2, 2], strides=[2, 2])
        if layer["op"] == "upsample":
            return self.upsample(inputs[0], output, number)
        return self.node("Concat", inputs, output, axis=1)

    def model(self, path, result):
        size, channels = self.network["input_size"], self.network["input_channels"]
        self.node("Identity", [result], "output")
        outputs = self.network["layers"][-1]["out_channels"]
        graph = helper.make_graph(
            self.nodes, "figurine",
            [helper.make_tensor_value_info("input", TensorProto.FLOAT, [1, channels, size, size])],
            [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, outputs, size, size])],
            self.constants,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
        model.ir_version = IR_VERSION
        onnx.checker.check_model(model)
        onnx.save(model, str(path))


def write_float(folder):
    graph = Graph(folder)
    names = ["input"]
    for i, layer in enumerate(graph.network["layers"]):
        inputs = [names[k] for k in layer["inputs"]]
        if layer["op"] == "conv":
            weights = graph.constant(f"w{i}", graph.kernel(layer, "weights", numpy.float32))
            bias = graph.constant(f"b{i}", graph.array(layer["bias"], numpy.float32))
            names.append(graph.convolution(layer, [inputs[0], weights, bias], f"v{i + 1}"))
        else:
            names.append(graph.moved(layer, inputs, f"v{i + 1}", i))
    graph.model(folder / "f32.onnx", names[-1])


def write_integers(folder):
    graph = Graph(folder)
    layers, values = graph.network["layers"], graph.network["values"]

    def quantisation(value):
        scale, zero = f"scale{value}", f"zero{value}"
        if not any(constant.name == scale for constant in graph.constants):
            graph.constant(scale, numpy.float32(values[value]["scale"]))
            graph.constant(zero, numpy.int8(values[value]["zero_point"]))
        return scale, zero

    def rounded(name, value):
        """What is left of a value in int8, in float."""
        scale, zero = quantisation(value)
        graph.node("QuantizeLinear", [name, scale, zero], f"{name}_q")
        return graph.node("DequantizeLinear", [f"{name}_q", scale, zero], f"{name}_dq")

    names = ["input"]
    for i, layer in enumerate(layers):
        inputs = [names[k] for k in layer["inputs"]]
        if layer["op"] == "conv":
            source = layer["inputs"][0]
            weight_scale = graph.array(layer["weight_scale"], numpy.float32)
            scales = graph.constant(f"ws{i}", weight_scale)
            zeros = graph.constant(f"wz{i}", numpy.zeros(len(weight_scale), numpy.int8))
            stored = graph.constant(f"w{i}", graph.kernel(layer, "fixed_weights", numpy.int8))
            weights = graph.node("DequantizeLinear", [stored, scales, zeros], f"w{i}_dq", axis=0)
            bias_scale = (numpy.float32(values[source]["scale"]) * weight_scale).astype("float32")
            bias = graph.node(
                "DequantizeLinear",
                [graph.constant(f"b{i}", graph.array(layer["fixed_bias"], numpy.int32)),
                 graph.constant(f"bs{i}", bias_scale),
                 graph.constant(f"bz{i}", numpy.zeros(len(weight_scale), numpy.int32))],
                f"b{i}_dq", axis=0)
            name = graph.convolution(layer, [inputs[0], weights, bias], f"v{i + 1}")
        else:
            name = graph.moved(layer, inputs, f"v{i + 1}", i)
        names.append(rounded(name, i + 1) if i + 1 < len(layers) else name)
    graph.model(folder / "q8.onnx", names[-1])


def cpu_name():
    for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=pathlib.Path, default=pathlib.Path("build/dev"))
    parser.add_argument("--output", type=pathlib.Path,
                        default=pathlib.Path("docs/results/network_peers.json"))
    options = parser.parse_args()
    program = options.build / "tests/bench/network_peers"
    if not program.exists():
        sys.exit(f"network_peers.py: {program} is not built")
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([program, "export", *SCENE, folder], check=True)
        write_float(folder)
        write_integers(folder)
        run = subprocess.run([program, "run", *SCENE, folder], check=True, stdout=subprocess.PIPE)
    report = json.loads(run.stdout)
    for row in report["rows"]:
        print(f"{row['name']}: {row['median_ms']:.2f} ms ({row['median_cpu_ms']:.2f} of CPU), "
              f"{row['ratio_to_figurine']:.2f} of {row['against']} "
              f"({row['cpu_ratio_to_figurine']:.2f}); largest error {row['largest_error']:.3g}")
    left_out = [] if any("torch" in row["name"] for row in report["rows"]) else ["LibTorch"]
    results.write(options.output, results.head("scripts/experiments/network_peers.py") | {
        "machine": {"cpu": cpu_name(), "cpus": len(os.sched_getaffinity(0)),
                    "load_before": round(load, 2)},
        "scene": " ".join(str(path) for path in SCENE),
        "threads": 1,
        "left_out": left_out,
        **report,
    })


if __name__ == "__main__":
    main()
