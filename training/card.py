"""The card of a run: its record in words, as a ``README.md`` that lies beside the weights.

It is made of the record alone, and names the weights by their hash: who copies a card, or changes a run under one, can
be told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from handsight.datasets.atomic import atomic_file
from handsight.datasets.errors import counted
from handsight.training.run_figures import figures_of, input_words, version_of
from handsight.training.run_folder import CARD, CARD_MARK, WEIGHTS, is_card
from handsight.training.run_record import WEIGHTS_SHA256, origins_of

_READS = {"rgbd": "colour and height", "rgb": "colour alone", "depth": "height alone"}
_LARGEST_CARD_BYTES = 1 << 20


def write_card(folder: Path, record: Mapping[str, Any]) -> None:
    """Write the card of a run whose record and weights are in place; a file that is not ours stays.

    Raises:
        OSError: The disk is full or not writable.
    """
    path = folder / CARD
    if path.exists() and not is_card(path):
        return
    with atomic_file(path, durable=True) as unfinished:
        unfinished.write_text(card_text(record), encoding="utf-8")


def remove_card(folder: Path) -> None:
    """Remove the card of a run that is about to be replaced; a file that is not ours stays.

    Raises:
        OSError: The folder is not writable.
    """
    if is_card(folder / CARD):
        (folder / CARD).unlink()


def names_weights(path: Path, weights_sha256: str | None) -> bool:
    """Whether a card is about the weights with that hash."""
    with path.open("rb") as file:
        text = file.read(_LARGEST_CARD_BYTES)
    return weights_sha256 is not None and f"`{weights_sha256}`".encode() in text


def card_text(record: Mapping[str, Any]) -> str:
    """The card of a run, as Markdown.

    Args:
        record: Of the run, as ``run_record.read_values`` gives it.
    """
    parts = (
        ("", _what(record)),
        ("Data", _data(record)),
        ("Recipe", _recipe(record)),
        ("On held-out attempts", _figures(record)),
        ("Limits", (f"- {statement}" for statement in limits(record))),
        ("Use", _use()),
    )
    lines = [CARD_MARK, "# A Grasp Quality Network", ""]
    for heading, paragraphs in parts:
        lines += [f"## {heading}", ""] if heading else []
        lines += [*paragraphs, ""]
    return "\n".join(lines)


def _what(record: Mapping[str, Any]) -> Iterator[str]:
    network, grid, figures = record["settings"]["network"], record["grid"], figures_of(record)
    size = f", with {counted(figures.parameters, 'parameter')}" if figures.parameters is not None else ""
    yield (
        "From one picture of a camera on the gripper, moved to a grasp by a planar homography, it predicts the chance "
        f"that the grasp succeeds. It is a convolutional network{size}."
    )
    yield ""
    yield f"- reads: {_READS[network['channels']]} (`{network['channels']}`)"
    yield f"- input, around the grasp: {input_words(grid)}"
    yield f"- convolutions: widths {_list(network['widths'])}, kernels {_list(network['kernels'])}, stride 2"
    yield f"- dense layers: {_list(network['dense'])}"
    yield f"- weights: `{WEIGHTS}`, SHA-256 `{record.get(WEIGHTS_SHA256)}`"
    yield f"- written: {_code(figures.created)} by handsight {_code(figures.handsight)}"


def _data(record: Mapping[str, Any]) -> Iterator[str]:
    for origin in origins_of(dict(record)):
        yield f"- {_code(version_of(origin))}: {counted(origin['attempts'], 'attempt')}, {origin['view']} picture"
        yield f"  - snapshot {_code(origin['snapshot'])}"
        yield f"  - content digest {_code(origin['digest'])}"
        known = {"dataset", "ref", "snapshot", "digest", "view", "attempts"}
        yield from (f"  - {name}: {_code(value)}" for name, value in origin.items() if name not in known)


def _recipe(record: Mapping[str, Any]) -> Iterator[str]:
    figures = figures_of(record)
    kept = "" if figures.kept is None else f"; the network is that after pass {figures.kept}"
    yield f"{counted(figures.passes, 'pass', 'passes')} over the data{kept}."
    yield ""
    for name, value in record["settings"].items():
        if name != "network":
            inner = value.items() if isinstance(value, Mapping) else ()
            shown = ", ".join(f"{key} {part}" for key, part in inner) if inner else value
            yield f"- {name}: {_code(shown)}"


def _figures(record: Mapping[str, Any]) -> Iterator[str]:
    figures = figures_of(record)
    if figures.held_out is None:
        yield "The record does not say after which pass the network was kept, so it has no figures."
        return
    yield f"- attempts: {figures.held_out}"
    for name, value in (("balanced accuracy at S > 0.5", figures.accuracy), ("AUC", figures.auc)):
        yield f"- {name}: " + ("too few attempts to say" if value is None else f"{value:.3f}")
    yield "- cross-entropy: " + ("no attempt to say" if figures.loss is None else f"{figures.loss:.4f}")


def limits(record: Mapping[str, Any]) -> Iterator[str]:
    """For what the figures of a run do not hold, one statement each; words of commands are in backticks."""
    if record["settings"].get("balance"):
        yield (
            "A score is no chance: both classes counted alike in training, however rare successes were. Scores rank "
            "grasps."
        )
    else:
        yield (
            "A score is the predicted chance that a grasp succeeds, among grasps as those of the data. Where grasps "
            "are chosen by it, or succeed more or less often than there, it has to be compared with what happens, as "
            "`--calibration` of `evaluate` does."
        )
    yield (
        "Held-out attempts are of the same objects, station and sessions as the others, and the pass that is kept "
        "was chosen by them. Expect less on what the data do not show."
    )
    yield (
        "Nothing here was tried in a servo loop, on objects that the data lack, with another camera, gripper or "
        "table, or on another robot. Training alone does not do that."
    )


def _use() -> Iterator[str]:
    yield "`RUN` is the folder of this file."
    yield ""
    yield "```sh"
    yield "handsight evaluate --model RUN     # how often it grasps, on objects of your choice"
    yield "handsight servo --model RUN"
    yield "handsight runs show RUN            # all of this, and whether the weights are those named here"
    yield "```"


def _list(values: object) -> str:
    return ", ".join(map(str, values)) if isinstance(values, list | tuple) else str(values)


def _code(value: object) -> str:
    """A value as it is written: names of datasets may hold what Markdown takes for something else."""
    text = " ".join(str(value).split()).replace("`", "'")
    return f"`{text}`" if text else "-"
