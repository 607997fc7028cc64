"""Every parser of input from elsewhere: good input for it, how it is spoilt, and the public way in."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import torch
import trimesh
from tests.support.factories import make_attempt, make_header, record
from tests.support.fuzz_mutations import (
    ODD_VALUES,
    ODD_WORDS,
    mutate_bytes,
    mutate_cells,
    mutate_file,
    mutate_folder,
    mutate_json_text,
    mutate_text,
    one_of,
)
from tests.support.meshes import block, pyramid, stl
from typer.main import get_command

from handsight.cli.app import app, run
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.sim.objects.meshes.plan import plan_import
from handsight.datasets import GraspRepository
from handsight.servoing.homography import InputGrid
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, load_run, save_run
from handsight.training.trainer import TrainSettings

Spoil = Callable[[Path, np.random.Generator], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parser:
    """Something that reads what it did not write."""

    make: Callable[[Path], None]
    """Fill an empty folder with good input."""
    spoil: Callable[[Path, np.random.Generator], Any]
    """Change it, or say what to ask of it."""
    parse: Callable[[Path, Any], int]
    """Read it: exit status. Typed errors are raised."""


def command(*words: str) -> int:
    """Run the command line with its output thrown away."""
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        return run(list(words))


def make_dataset(folder: Path) -> None:
    """Six attempts of small pictures."""
    header = make_header()
    repository = GraspRepository.create(folder / "grasps")
    record(repository, header, [make_attempt(header, number) for number in range(4)])


def make_export(format: str, name: str, folder: Path) -> None:
    """An export, and no longer the dataset that it was made from."""
    make_dataset(folder)
    assert command("dataset", "export", str(folder / "grasps"), str(folder / name), "--format", format) == 0
    shutil.rmtree(folder / "grasps")


def make_images(folder: Path) -> None:
    """A table of pictures with its station."""
    (folder / "set").mkdir()
    station = {
        "source": "lab",
        "camera": {
            "intrinsics": {"width": 16, "height": 12, "fx": 15.0, "fy": 15.0, "cx": 7.5, "cy": 5.5},
            **{"x_tool_camera_m": 0.0, "y_tool_camera_m": -0.055, "z_tool_camera_m": -0.1},
        },
        **{"depth_scale_m": 0.001, "gripper_stroke_m": 0.085, "closed_width_m": 0.002, "pregrasp_height_m": 0.4},
        **{"objects": ["cup", "bowl"], "conditions": [], "serials": None},
    }
    (folder / "set" / "station.json").write_text(json.dumps(station))
    names = (
        "overhead_rgb,overhead_depth,overhead_x_m,overhead_y_m,overhead_z_m,overhead_angle_rad,pregrasp_x_m,"
        "pregrasp_y_m,pregrasp_angle_rad,grasp_z_m,width_final_m,target,contact_force_n,started_ns"
    )
    rows = [names]
    for number in range(3):
        cv2.imwrite(str(folder / "set" / f"c{number}.png"), np.full((12, 16, 3), 90, np.uint8))
        cv2.imwrite(str(folder / "set" / f"d{number}.png"), np.full((12, 16), 600, np.uint16))
        rows.append(
            f"c{number}.png,d{number}.png,0.55,0.0,0.6,0.0,0.5{number},0.0,-1.0,0.03,0.03,cup,1.0,1700000000{number}00000000"
        )
    (folder / "set" / "attempts.csv").write_text("\n".join(rows) + "\n")


def import_of(name: str, folder: Path, _: Any) -> int:
    """A whole import; the dataset it would make is taken away again."""
    try:
        return command("dataset", "import", str(folder / name), str(folder / "new"))
    finally:
        shutil.rmtree(folder / "new", ignore_errors=True)


def spoil_hdf5(folder: Path, rng: np.random.Generator) -> None:
    """Bytes, attributes, types, shapes and links."""
    path = folder / "grasps.hdf5"
    if rng.random() < 0.3:
        mutate_file(path, rng)
        return
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        name = one_of(names, rng)
        kind = int(rng.integers(6))
        item = file[name]
        holder = one_of([item, file, *(file[group] for group in names if isinstance(file[group], h5py.Group))], rng)
        if kind <= 1 and len(holder.attrs):
            attribute = one_of(holder.attrs, rng)
            text = holder.attrs[attribute]
            if isinstance(text, str) and text.startswith(("{", "[")) and rng.random() < 0.8:
                holder.attrs[attribute] = mutate_json_text(text, rng).encode(errors="replace").replace(b"\0", b"")
            else:
                holder.attrs[attribute] = one_of((1, -1, 2**62, 0.5, "x", "", np.zeros((3, 2)), b"\xff"), rng)
        elif kind == 2:
            del file[name]
        elif kind == 3 and isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.size:
            item[...] = np.asarray(one_of((0, 1, 100, 255), rng)).astype(item.dtype)
            if item.dtype.kind == "f" and rng.random() < 0.7:
                item[...] = one_of((np.nan, np.inf, 1e300, -1e9), rng)
        elif kind == 4:
            del file[name]
            file[name] = one_of(
                (
                    np.zeros(3),
                    "text",
                    np.zeros((2, 2), np.uint8),
                    h5py.SoftLink("/data"),
                    h5py.ExternalLink("x.h5", "/"),
                ),
                rng,
            )
        else:
            del file[name]
            file.create_dataset(name, shape=(2**33,), dtype="f8", chunks=(1024,), compression="gzip")


def make_mesh(suffix: str, folder: Path) -> None:
    """One mesh of a kind, with whatever it names."""
    (folder / "meshes").mkdir()
    if suffix in ("obj", "mtl"):
        (folder / "meshes" / "one.obj").write_bytes(pyramid("one.mtl"))
        (folder / "meshes" / "one.mtl").write_text("newmtl m\nKd 0.5 0.5 0.5\nmap_Kd -s 1 1 1 t.png\n")
        cv2.imwrite(str(folder / "meshes" / "t.png"), np.full((4, 4, 3), 90, np.uint8))
    elif suffix == "stl":
        (folder / "meshes" / "one.stl").write_bytes(stl(block()))
        (folder / "meshes" / "two.stl").write_text(trimesh.exchange.stl.export_stl_ascii(block()))
    else:
        block().export(folder / "meshes" / f"one.{suffix}")
        if suffix == "ply":
            block().export(folder / "meshes" / "two.ply", encoding="ascii")


def spoil_mesh(suffix: str, folder: Path, rng: np.random.Generator) -> None:
    """Text as text, and the description of a glb as a tree."""
    path = one_of(sorted((folder / "meshes").glob(f"*.{suffix}")), rng)
    content = path.read_bytes()
    if suffix in ("obj", "mtl") or path.name.startswith("two."):
        path.write_text(mutate_text(content.decode(), rng), errors="replace")
    elif suffix == "glb" and rng.random() < 0.7:
        size = int.from_bytes(content[12:16], "little")
        text = mutate_json_text(content[20 : 20 + size].decode(), rng).encode(errors="replace")
        text += b" " * (-len(text) % 4)
        rest = len(text).to_bytes(4, "little") + content[16:20] + text + content[20 + size :]
        path.write_bytes(content[:8] + (12 + len(rest)).to_bytes(4, "little") + rest)
    else:
        path.write_bytes(mutate_bytes(content, rng))


def parse_meshes(folder: Path, _: Any) -> int:
    """What an import reads, without cutting anything."""
    plan_import(folder / "meshes", "mine")
    return 0


def make_object_set(folder: Path) -> None:
    """An imported set, as a folder that can be named."""
    (folder / "meshes").mkdir()
    block().export(folder / "meshes" / "one.stl")
    shutil.copytree(import_folder(folder / "meshes", f"set-{abs(hash(folder))}").folder, folder / "set")


def parse_object_set(folder: Path, _: Any) -> int:
    """A set by its folder."""
    load_object_set(str(folder / "set"))
    return 0


def make_run(folder: Path) -> None:
    """A network of the smallest size."""
    torch.manual_seed(0)
    save_run(
        folder / "run",
        GraspQualityNetwork(GqnConfig(size_px=16)),
        origin=DataOrigin(dataset="grasps", ref="v1", snapshot="A", digest="d" * 64, view="overhead", attempts=8),
        grid=InputGrid(crop_px=100, size_px=16),
        settings=TrainSettings(network=GqnConfig(size_px=16)),
        history=[],
    )


def parse_run(folder: Path, _: Any) -> int:
    """A run by its folder."""
    load_run(folder / "run")
    return 0


WHERE = (
    "success == 1 and width_final_m > 0.01",
    "outcome in ('held', 'empty')",
    "not (number < 3 or target == 'cup')",
    "target.str.contains('c.p')",
)


def where_words(folder: Path, rng: np.random.Generator) -> list[str]:
    """An expression."""
    del folder
    text = one_of(WHERE, rng)
    for _ in range(int(rng.integers(1, 4))):
        text = mutate_text(text, rng)
    return ["dataset", "ls", "{dataset}", f"--where={text}", "--json"]


def ref_words(_: Path, rng: np.random.Generator) -> list[str]:
    """A place, a version or an attempt's number."""
    verb = one_of(("info", "ls", "log", "stats"), rng)
    ref = one_of((*ODD_WORDS, mutate_text("main", rng), mutate_text("v1", rng)), rng)
    kind = int(rng.integers(3))
    if kind == 0:
        return ["dataset", verb, "{dataset}@" + ref]
    if kind == 1:
        return ["dataset", verb, mutate_text("s3://bucket/prefix@v1", rng) if rng.random() < 0.2 else ref + "/none"]
    return ["dataset", "show", "{dataset}", ref]


SLOW = ("view", "heatmap", "servo", "demo", "train", "evaluate", "collect", "review", "report", "crossval", "ablate")
"""What would work for long, or open a window: of these the words are parsed, and nothing is carried out."""


def commands() -> list[tuple[list[str], Any]]:
    """Every command with its words."""
    found: list[tuple[list[str], Any]] = []

    def walk(words: list[str], one: Any) -> None:
        if hasattr(one, "list_commands"):
            with one.make_context("handsight", [], resilient_parsing=True) as context:
                for name in one.list_commands(context):
                    walk([*words, name], one.get_command(context, name))
        else:
            found.append((words, one))

    walk([], get_command(app))
    return found


def option_words(_: Path, rng: np.random.Generator) -> list[str]:
    """Some option of some command with a value that it may not expect."""
    words, one = one_of(commands(), rng)
    options = [item for item in one.params if item.param_type_name == "option" and not item.is_flag]
    chosen = [one_of(options, rng) for _ in range(int(rng.integers(1, 3))) if options]
    values = (*ODD_WORDS, *map(str, ODD_VALUES[13:30]))
    given = [f"{option.opts[0]}={one_of(values, rng)}" for option in chosen]
    dataset = "{nothing}" if words[0] in SLOW or words[:1] == ["objects"] else "{dataset}"
    arguments = [item for item in one.params if item.param_type_name == "argument"]
    filled = [one_of((dataset, *ODD_WORDS), rng) if place else dataset for place, _ in enumerate(arguments)]
    return [*words, *given, "--", *filled] if filled else [*words, *given]


def parse_words(folder: Path, words: list[str]) -> int:
    """The command line, in the dataset's folder."""
    places = {"{dataset}": str(folder / "grasps"), "{nothing}": str(folder / "none")}
    filled = []
    for word in words:
        for name, place in places.items():
            word = word.replace(name, place)
        filled.append(word)
    if words[0] in SLOW:
        (one,) = (one for name, one in commands() if name == words[: len(name)])
        try:
            one.make_context(words[0], filled[1 + (words[0] == "collect") :])
        except (SystemExit, Exception) as error:
            if "click" not in type(error).__module__:
                raise
            return 2
        return 0
    return command(*filled)


def spoil_metadata(folder: Path, rng: np.random.Generator) -> None:
    """A decision, a filter or folds under odd names and reasons: they are read back by every command after."""
    word = one_of((*ODD_WORDS, mutate_text("left-hand", rng)), rng)
    dataset = str(folder / "grasps")
    kinds = (
        ("dataset", "filter", dataset, f"--name={word}", "--where=success == 1"),
        ("dataset", "exclude", dataset, "0", f"--reason={word}"),
        ("dataset", "folds", dataset, f"--name={word}", "--count=2"),
        ("dataset", "release", dataset, word),
        ("dataset", "branch", dataset, word),
    )
    command(*one_of(kinds, rng))


def parse_dataset(folder: Path, _: Any) -> int:
    """Everything that lists what is stored beside attempts."""
    dataset = str(folder / "grasps")
    return max(command("dataset", verb, dataset) for verb in ("info", "log"))


PARSERS: dict[str, Parser] = {
    "options": Parser(make=make_dataset, spoil=option_words, parse=parse_words),
    "where": Parser(make=make_dataset, spoil=where_words, parse=parse_words),
    "refs": Parser(make=make_dataset, spoil=ref_words, parse=parse_words),
    "stored": Parser(make=make_dataset, spoil=spoil_metadata, parse=parse_dataset),
    "station": Parser(
        make=make_images, spoil=lambda f, rng: mutate_file(f / "set/station.json", rng), parse=partial(import_of, "set")
    ),
    "csv": Parser(
        make=make_images,
        spoil=lambda f, rng: (f / "set/attempts.csv").write_text(
            mutate_cells((f / "set/attempts.csv").read_text(), rng), errors="replace"
        ),
        parse=partial(import_of, "set"),
    ),
    "pictures": Parser(
        make=make_images,
        spoil=lambda f, rng: mutate_file(one_of(sorted((f / "set").glob("*.png")), rng), rng),
        parse=partial(import_of, "set"),
    ),
    "hdf5": Parser(
        make=partial(make_export, "hdf5", "grasps.hdf5"), spoil=spoil_hdf5, parse=partial(import_of, "grasps.hdf5")
    ),
    "zarr": Parser(
        make=partial(make_export, "zarr", "set.zarr"),
        spoil=lambda f, rng: mutate_folder(f / "set.zarr", rng),
        parse=partial(import_of, "set.zarr"),
    ),
    "lerobot": Parser(
        make=partial(make_export, "lerobot", "set"),
        spoil=lambda f, rng: mutate_folder(f / "set", rng),
        parse=partial(import_of, "set"),
    ),
    "run": Parser(make=make_run, spoil=lambda f, rng: mutate_folder(f / "run", rng), parse=parse_run),
    "object-set": Parser(
        make=make_object_set, spoil=lambda f, rng: mutate_folder(f / "set", rng), parse=parse_object_set
    ),
    **{
        suffix: Parser(make=partial(make_mesh, suffix), spoil=partial(spoil_mesh, suffix), parse=parse_meshes)
        for suffix in ("obj", "mtl", "stl", "ply", "glb")
    },
}
