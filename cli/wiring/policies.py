"""Wires policy names to policies; the one place of collection that knows trained runs.

PyTorch takes seconds to import: only the servo policy needs it, and only once its options are sound.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handsight.cli.errors import CommandError
from handsight.cli.options import DEFAULT_METHOD, DEFAULT_THRESHOLD
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    from handsight.collection.policy import PregraspPolicy
    from handsight.servoing.homography import InputGrid
    from handsight.servoing.optimiser import ServoMethod
    from handsight.servoing.scorer import GraspScorer

DEFAULT_RANDOM_SHARE = 0.3


@dataclass(frozen=True, slots=True)
class RunNetwork:
    """Opens the network of a trained run in any process."""

    folder: Path
    sha256: str
    """Of its weights."""
    grid: InputGrid
    """Crop and size of its inputs."""

    def __call__(self) -> GraspScorer:
        """Load it, on one thread: several workers with several threads would only wait for each other.

        Raises:
            CheckpointError: The run is gone or damaged.
            CommandError: Another run has taken its place meanwhile.
        """
        import torch

        torch.set_num_threads(1)
        from handsight.training.run import load_run

        run = load_run(self.folder)
        if (run.weights_sha256, run.grid) != (self.sha256, self.grid):
            raise CommandError(
                f"{self.folder} holds another network (weights {run.weights_sha256[:12]}…) than when this began "
                f"({self.sha256[:12]}…): leave a run in its place while it is used, and begin again"
            )
        return run.scorer()


def policy_named(
    name: str,
    *,
    model: Path | None,
    method: str | None,
    random_share: float | None,
    threshold: float | None,
    level: bool = False,
) -> PregraspPolicy:
    """The policy that the options describe, its network checked before any process is started.

    Raises:
        CommandError: Options that do not go together.
        CheckpointError: The run is missing or damaged.
        UnknownMethodError: There is no such servo method.
        CollectionSettingsError: The random share is no share.
    """
    if name != "servo":
        given = {
            "--model": model,
            "--method": method,
            "--random-share": random_share,
            "--threshold": threshold,
            "--level": level or None,
        }
        extra = [option for option, value in given.items() if value is not None]
        if extra:
            raise CommandError(f"{', '.join(extra)} goes with --policy servo, and the policy is {name}")
        from handsight.collection.policy import UniformPolicy

        return UniformPolicy()
    if model is None:
        raise CommandError("--policy servo needs a trained network: name its folder with --model RUN")
    check_finished_run(model)
    from handsight.collection.servo_policy import ServoPolicy
    from handsight.servoing.loop import ServoSettings
    from handsight.servoing.methods.registry import servo_method

    servoing = servo_method(DEFAULT_METHOD if method is None else method)
    return ServoPolicy(
        open_network=_network(model),
        method=servoing,
        random_share=DEFAULT_RANDOM_SHARE if random_share is None else random_share,
        servo=ServoSettings(threshold=DEFAULT_THRESHOLD if threshold is None else threshold, level=level),
    )


def recorded_policy(settings: dict[str, Any], model: Path | None) -> PregraspPolicy | None:
    """The policy of a recorded session, to perform its attempts again; None where it cannot be made.

    Args:
        settings: What :meth:`PregraspPolicy.settings` gave.
        model: The run that the servo policy used, if it is at hand.
    """
    from handsight.collection.policy import UniformPolicy

    rest = {name: value for name, value in settings.items() if name != "name"}
    if settings.get("name") == "uniform":
        return UniformPolicy(**rest)
    if settings.get("name") != "servo" or model is None:
        return None
    from handsight.collection.servo_policy import ServoPolicy
    from handsight.servoing.loop import ServoSettings

    method = _recorded_method(rest)
    if method is None:
        return None
    network = _network(model)
    if network.sha256 != rest["weights_sha256"]:
        raise CommandError(
            f"{model} holds weights {network.sha256[:12]}…, and the session was collected with "
            f"{rest['weights_sha256'][:12]}…: name the run that collected it"
        )
    servo = rest["servo"]
    # Older sessions have the grid among the settings of the loop.
    grid = rest["grid"] if "grid" in rest else servo["grid"]
    if (here := network.grid.to_json()) != grid:
        raise CommandError(
            f"{model} has inputs {here}, and the session was collected with {grid}: name the run that collected it"
        )
    return ServoPolicy(
        open_network=network,
        method=method,
        random_share=rest["random_share"],
        start=UniformPolicy(half_range_m=rest["half_range_m"]),
        servo=ServoSettings.from_json(servo),
    )


def _recorded_method(recorded: dict[str, Any]) -> ServoMethod | None:
    """The method of a session; older ones have its name alone, and were collected with what the registry has of it."""
    from handsight.servoing.methods.registry import METHODS, recorded_method

    if "method_settings" not in recorded:
        return METHODS.get(recorded["method"])
    return recorded_method(recorded["method"], recorded["optimiser"], recorded["method_settings"])


def _network(model: Path) -> RunNetwork:
    from handsight.training.run import load_run

    run = load_run(model)
    return RunNetwork(model.resolve(), run.weights_sha256, run.grid)
