#!/usr/bin/env python3
"""The worked example of docs/numerics.md: three joints, five texels, one pose, one camera, from the
rest body to one pixel.

    scripts/make_five_texels.py > tests/golden/posing/five_texels.json

Written from the equations of docs/numerics.md alone, in plain Python and float64, so that it shares
no line with what it checks. Inputs are rounded to float32 first: both sides start from the same
numbers. tests/formats/posing_golden_test.cpp holds the shared arithmetic against it,
tests/stability/five_texels_test.cpp the renderer.
"""
import json
import math
import struct
import sys

K = 8  # joint influences a texel


def f32(value):
    """The nearest float32, element by element."""
    if isinstance(value, (list, tuple)):
        return [f32(element) for element in value]
    return struct.unpack("<f", struct.pack("<f", value))[0]


def influences(*pairs):
    pairs = list(pairs) + [(0, 0.0)] * (K - len(pairs))
    return [joint for joint, _ in pairs], [weight for _, weight in pairs]


SKIN = [
    influences((0, 1.0)),
    influences((0, 0.625), (1, 0.375)),
    influences((1, 0.5), (0, 0.25), (2, 0.25)),
    influences((2, 0.75), (1, 0.25)),
    influences((2, 1.0))
]

BODY = {
    "uv_size": 4,
    "joint_names": ["pelvis", "spine", "head"],
    "parents": [-1, 0, 1],
    "joint_position_m": f32([[0.0, 1.0, 0.0], [0.0, 1.25, 0.03125], [0.0625, 1.5, 0.0]]),
    "joint_shape_basis_m": f32([[[0.0, 0.125, 0.0], [0.0, 0.1875, 0.0], [0.0, 0.25, 0.03125]]]),
    "texel": [1, 5, 6, 10, 14],
    "texel_position_m": f32([[0.1, 0.95, 0.12], [0.125, 1.1, 0.14], [-0.05, 1.27, 0.15],
                             [0.03, 1.42, 0.13], [0.0625, 1.6, 0.11]]),
    "texel_normal": f32([[0.6, 0.0, 0.8], [0.8, 0.0, 0.6], [-0.28, 0.0, 0.96], [0.0, 0.28, 0.96],
                         [0.0, 0.6, 0.8]]),
    "texel_joints": [joints for joints, _ in SKIN],
    "texel_weights": [weights for _, weights in SKIN],
    "texel_spacing_m": f32([0.05, 0.06, 0.05, 0.045, 0.04]),
    "texel_shape_basis_m": f32([[[0.01, 0.12, 0.02], [0.015, 0.14, 0.02], [-0.01, 0.19, 0.025],
                                 [0.005, 0.22, 0.02], [0.0, 0.26, 0.03]]]),
    "border_texel": [0, 9],
    "border_source": [0, 3],
}

FOURIER_OCTAVES = 1
INPUTS = 6 + 4 * FOURIER_OCTAVES
OUTPUTS = 14  # offset 3, log-scale 3, quaternion 4, opacity 1, SH of degree 0: 3

AVATAR = {
    "shape": [0.5],
    "map_mean": f32([0.0, 0.25, 0.0, 0.0, 0.0, 0.25]),
    "map_scale": [2.0, 2.0, 2.0, 1.0, 1.0, 1.0],
    "fourier_octaves": FOURIER_OCTAVES,
    "offset_scale_m": f32(0.05),
    "spacing_scale": f32(0.6),
    "max_log_scale": 4.0,
    "opacity_bias": 2.0,
    # The network is one 1x1 convolution, so that its output can be followed by hand. Rows are
    # outputs. An arbitrary but smooth pattern of eighths.
    "weights": [[(((7 * row + 4 * column) % 9) - 4) / 8 for column in range(INPUTS)]
                for row in range(OUTPUTS)],
    "bias": [(((5 * row) % 7) - 3) / 8 for row in range(OUTPUTS)],
}

POSE = {
    "root_translation_m": f32([0.1, -0.05, 0.2]),
    "rotations": f32([[8.0, 1.0, 2.0, -1.0], [4.0, 1.0, 0.0, 1.0], [0.8, 0.0, 0.6, 0.0]])
}

CAMERA = {  # turned by 16.26 degrees about y (a 7-24-25 triangle), then OpenCV axes
    "width_px": 64,
    "height_px": 48,
    "fx_px": 80.0,
    "fy_px": 75.0,
    "cx_px": 31.0,
    "cy_px": 25.5,
    "near_m": f32(0.2),
    "view_from_world": f32([0.96, 0.0, -0.28, 0.1, 0.0, -1.0, 0.0, 1.25, -0.28, 0.0, -0.96, 2.0]),
}
PIXELS = [[41, 27], [43, 29], [45, 24], [43, 36], [10, 10]]  # a centre, three overlaps, nothing
DILATION, ALPHA_CUT, ALPHA_MAX, STOP = 0.3, 1 / 255, 0.99, 1e-4
SH0 = 0.28209479177387814


def matmul(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(len(b))) for j in range(len(b[0]))]
            for i in range(len(a))]


def matvec(a, x):
    return [sum(row[k] * x[k] for k in range(len(x))) for row in a]


def add(a, b):
    return [p + q for p, q in zip(a, b)]


def subtract(a, b):
    return [p - q for p, q in zip(a, b)]


def transpose(a):
    return [list(column) for column in zip(*a)]


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def normalise(a):
    return [value / math.sqrt(dot(a, a)) for value in a]


def inverse(a):
    """Of a 3x3 matrix, by the adjugate."""
    cofactors = [cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])]
    return transpose([[value / dot(a[0], cofactors[0]) for value in row] for row in cofactors])


def rotation(wxyz):
    """q v q* for the three unit vectors: columns of the rotation matrix."""
    w, *v = normalise(wxyz)
    columns = []
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        t = [2 * value for value in cross(v, axis)]
        columns.append(add(add(axis, [w * value for value in t]), cross(v, t)))
    return transpose(columns)


def skinning_transforms(joints):
    """Per joint the 3x4 matrix of B_j x = R_j (x - r_j) + p_j."""
    world = []
    for j, parent in enumerate(BODY["parents"]):
        local = rotation(POSE["rotations"][j])
        if parent < 0:
            world.append((local, add(joints[j], POSE["root_translation_m"])))
        else:
            parent_rotation, parent_position = world[parent]
            bone = matvec(parent_rotation, subtract(joints[j], joints[parent]))
            world.append((matmul(parent_rotation, local), add(parent_position, bone)))
    return [[row + [p[i] - dot(row, joints[j])] for i, row in enumerate(r)]
            for j, (r, p) in enumerate(world)]


def blend(transforms, i):
    pairs = list(zip(BODY["texel_joints"][i], BODY["texel_weights"][i]))
    return [[sum(w * transforms[j][row][column] for j, w in pairs) for column in range(4)]
            for row in range(3)]


def apply(transform, point):
    return [dot(row[:3], point) + row[3] for row in transform]


def linear(transform):
    return [row[:3] for row in transform]


def shaped(mean, basis):
    return [[
        value + sum(c * direction[i][k] for c, direction in zip(AVATAR["shape"], basis))
        for k, value in enumerate(row)
    ] for i, row in enumerate(mean)]


def network_input(position, normal, texel):
    maps = [
        (value - mean) * scale
        for value, mean, scale in zip(position + normal, AVATAR["map_mean"], AVATAR["map_scale"])
    ]
    size = BODY["uv_size"]
    x, y = (texel % size + 0.5) / size, (texel // size + 0.5) / size
    for octave in range(FOURIER_OCTAVES):
        for coordinate in (x, y):
            maps += [
                math.sin(math.pi * 2**octave * coordinate),
                math.cos(math.pi * 2**octave * coordinate)
            ]
    return maps


def decode(head, i, transform, canonical):
    offset = [AVATAR["offset_scale_m"] * value for value in head[0:3]]
    bound = AVATAR["max_log_scale"]
    scale = [
        AVATAR["spacing_scale"] * BODY["texel_spacing_m"][i] *
        math.exp(min(max(value, -bound), bound)) for value in head[3:6]
    ]
    turned = matmul(linear(transform), rotation(add([1, 0, 0, 0], head[6:10])))
    factor = [[row[k] * scale[k] for k in range(3)] for row in turned]
    return {
        "scale_m": scale, "centre_m": apply(transform, add(canonical, offset)), "factor": factor,
        "covariance_m2": matmul(factor, transpose(factor)),
        "opacity": 1 / (1 + math.exp(-(head[10] + AVATAR["opacity_bias"]))), "sh": head[11:14]
    }


def project(gaussian):
    rows = [CAMERA["view_from_world"][4 * i:4 * i + 4] for i in range(3)]
    view = apply(rows, gaussian["centre_m"])
    side = {
        "x": (CAMERA["fx_px"], CAMERA["cx_px"], CAMERA["width_px"]),
        "y": (CAMERA["fy_px"], CAMERA["cy_px"], CAMERA["height_px"])
    }
    tangent, jacobian, mean = [], [], []
    for axis, (f, c, size) in enumerate(side.values()):
        mean.append(f * view[axis] / view[2] + c)
        tangent.append(
            min(max(view[axis] / view[2], -(c + 0.15 * size) / f), (size - c + 0.15 * size) / f))
        row = [0.0, 0.0, -f / view[2] * tangent[axis]]
        row[axis] = f / view[2]
        jacobian.append(row)
    to_image = matmul(jacobian, linear(rows))
    # The textbook form, J W S W^T J^T.
    covariance = matmul(matmul(to_image, gaussian["covariance_m2"]), transpose(to_image))
    a, b, c = covariance[0][0] + DILATION, covariance[0][1], covariance[1][1] + DILATION
    det = a * c - b * b
    reach = math.log(gaussian["opacity"] / ALPHA_CUT)
    return {
        "view_m": view, "mean_px": mean, "covariance_px2": [a, b, c], "determinant_px4": det,
        "conic": [c / det, -b / det, a / det],
        "half_box_px": [math.sqrt(2 * reach * a), math.sqrt(2 * reach * c)],
        "colour": [max(SH0 * value + 0.5, 0.0) for value in gaussian["sh"]]
    }


def alpha_at(gaussian, projection, centre):
    dx, dy = subtract(centre, projection["mean_px"])
    p, q, r = projection["conic"]
    power = -0.5 * (p * dx * dx + 2 * q * dx * dy + r * dy * dy)
    alpha = min(ALPHA_MAX, gaussian["opacity"] * math.exp(power))
    return alpha if alpha >= ALPHA_CUT else 0.0


def composite(gaussians, projections, pixel):
    centre, transmittance = add(pixel, [0.5, 0.5]), 1.0
    colour, alphas = [0.0, 0.0, 0.0], [0.0] * len(gaussians)
    for i in sorted(range(len(gaussians)), key=lambda i: projections[i]["view_m"][2]):
        alphas[i] = alpha_at(gaussians[i], projections[i], centre)
        after = transmittance * (1 - alphas[i])
        if after < STOP:
            break
        colour = [
            value + transmittance * alphas[i] * c
            for value, c in zip(colour, projections[i]["colour"])
        ]
        transmittance = after
    return {
        "pixel": pixel, "alphas": alphas, "premultiplied_colour": colour, "alpha": 1 - transmittance
    }


def layout(value, indent=""):
    """JSON with one line for whatever holds no object and fits on it."""
    flat = json.dumps(value)
    if len(indent) + len(flat) <= 140 and "{" not in flat:
        return flat
    inner = indent + " "
    if isinstance(value, dict):
        parts = [
            f"{inner}{json.dumps(key)}: {layout(element, inner)}" for key, element in value.items()
        ]
        return "{\n" + ",\n".join(parts) + "\n" + indent + "}"
    return "[\n" + ",\n".join(
        inner + layout(element, inner) for element in value) + "\n" + indent + "]"


def main():
    count = len(BODY["texel"])
    mean_transforms = skinning_transforms(BODY["joint_position_m"])
    own_joints = shaped(BODY["joint_position_m"], BODY["joint_shape_basis_m"])
    own_texels = shaped(BODY["texel_position_m"], BODY["texel_shape_basis_m"])
    own_transforms = skinning_transforms(own_joints)
    root = add(BODY["joint_position_m"][0], POSE["root_translation_m"])
    texels, gaussians = [], []
    for i in range(count):
        mean_blend, own_blend = blend(mean_transforms, i), blend(own_transforms, i)
        position = subtract(apply(mean_blend, BODY["texel_position_m"][i]), root)
        normal = normalise(matvec(transpose(inverse(linear(mean_blend))), BODY["texel_normal"][i]))
        inputs = network_input(position, normal, BODY["texel"][i])
        head = add(matvec(AVATAR["weights"], inputs), AVATAR["bias"])
        gaussians.append(decode(head, i, own_blend, own_texels[i]))
        texels.append({
            "mean_blend": mean_blend, "own_blend": own_blend, "own_position_m": own_texels[i],
            "map_position_m": position, "map_normal": normal, "network_input": inputs, "head": head,
            "gaussian": gaussians[-1], "projection": project(gaussians[-1])
        })
    projections = [texel["projection"] for texel in texels]
    pixels = [composite(gaussians, projections, pixel) for pixel in PIXELS]
    expected = {
        "mean_world_from_rest": mean_transforms, "own_joint_position_m": own_joints,
        "own_world_from_rest": own_transforms, "texels": texels, "pixels": pixels
    }
    document = {
        "about": "docs/numerics.md, five texels: made by scripts/make_five_texels.py in float64",
        "body": BODY, "avatar": AVATAR, "pose": POSE, "camera": CAMERA, "expected": expected
    }
    sys.stdout.write(layout(document) + "\n")


if __name__ == "__main__":
    main()
