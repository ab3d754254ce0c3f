"""Triangle meshes: read STL, thin them out, write OBJ (the format Drake loads).

Plain numpy; arrays are (n_triangles, 3, 3) float64 in metres unless said otherwise.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

CREASE = 0.75
"""Cosine above which a corner is shaded smoothly; below it the edge stays sharp."""


def read_stl(path: Path) -> Array:
    """Corners of the triangles of a binary or ASCII STL file, in the file's own unit."""
    data = path.read_bytes()
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        record: Any = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("pad", "<u2")])
        return np.frombuffer(data, record, count, 84)["corners"].astype(np.float64)
    corners = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", data)
    return np.array(corners, dtype=np.float64).reshape(-1, 3, 3)


def decimate(triangles: Array, cell: float) -> tuple[Array, Indices]:
    """Merge the corners that share a cube of side `cell` (metres) into their mean.

    Returns vertices (n, 3) and faces (m, 3); triangles that collapse or repeat are left out.
    """
    corners = triangles.reshape(-1, 3)
    key = np.round(corners / cell).astype(np.int64)
    _, group = np.unique(key, axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    vertices = np.stack([np.bincount(group, corners[:, axis]) / count for axis in range(3)], axis=1)
    faces = group.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (a != c)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices, faces[np.sort(first)]


def corner_normals(vertices: Array, faces: Indices) -> Array:
    """Normals (m, 3, 3) of every face corner: smooth on curved skins, flat across sharp edges."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    flat = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-12)
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], area)
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    smooth = total[faces]
    sharp = np.einsum("fkx,fx->fk", smooth, flat) < CREASE
    return np.where(sharp[:, :, None], flat[:, None, :], smooth)


def write_obj(path: Path, vertices: Array, faces: Indices) -> None:
    """Write an OBJ file with normals; normals are shared where they agree to a hundredth."""
    rounded = np.round(corner_normals(vertices, faces).reshape(-1, 3), 2) + 0.0
    normals, which = np.unique(rounded, axis=0, return_inverse=True)
    corner = which.reshape(-1, 3) + 1
    lines = ["v {:.4f} {:.4f} {:.4f}\n".format(*v) for v in vertices]
    lines += ["vn {:.2f} {:.2f} {:.2f}\n".format(*n) for n in normals]
    for face, n in zip(faces + 1, corner, strict=True):
        lines.append(f"f {face[0]}//{n[0]} {face[1]}//{n[1]} {face[2]}//{n[2]}\n")
    path.write_text("".join(lines), encoding="ascii")
