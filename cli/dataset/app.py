"""``handsight dataset``: its commands, one file for each group of them."""

from __future__ import annotations

from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app

COMMANDS = (
    # Make and name versions.
    LazyCommand(
        "init",
        "dataset.versions:init",
        "Create an empty dataset.",
        ("handsight dataset init grasps", "handsight dataset init s3://lab/week/grasps"),
    ),
    LazyCommand(
        "release",
        "dataset.versions:release",
        "Give a version an immutable name.",
        ("handsight dataset release grasps v1 -m 'first hundred'", "handsight dataset release grasps@trial v2"),
    ),
    LazyCommand(
        "branch",
        "dataset.versions:branch",
        "Create, list or delete branches.",
        (
            "handsight dataset branch grasps",
            "handsight dataset branch grasps@v1 trial",
            "handsight dataset branch grasps trial --delete",
        ),
    ),
    LazyCommand(
        "diff",
        "dataset.versions:diff",
        "Compare two versions.",
        ("handsight dataset diff grasps@v1 main", "handsight dataset diff grasps@v1 copy@v1 --json"),
    ),
    LazyCommand(
        "revert",
        "dataset.versions:revert_command",
        "Give a branch the content of another version.",
        ("handsight dataset revert grasps v1 --dry-run", "handsight dataset revert grasps v1 -m 'back to v1'"),
    ),
    LazyCommand(
        "migrate",
        "dataset.versions:migrate_command",
        "Bring a version of an older schema forward.",
        ("handsight dataset migrate grasps@v1 --branch newest",),
    ),
    # Look into one.
    LazyCommand(
        "info",
        "dataset.inspect:info",
        "Summarise a version: size, balance, digest.",
        ("handsight dataset info grasps", "handsight dataset info grasps@v1 --json"),
    ),
    LazyCommand(
        "log",
        "dataset.inspect:log",
        "List the commits of a version, newest first.",
        ("handsight dataset log grasps",),
    ),
    LazyCommand(
        "ls",
        "dataset.inspect:ls",
        "List attempts.",
        (
            "handsight dataset ls grasps --where \"target == 'cup' and success\"",
            "handsight dataset ls grasps --sort contact_force_n --reverse -n 5",
            "handsight dataset ls grasps --filter slips --ids",
        ),
    ),
    LazyCommand(
        "show",
        "dataset.inspect:show",
        "Print everything known of an attempt.",
        ("handsight dataset show grasps 92", "handsight dataset show grasps 92 --picture attempt.png"),
    ),
    LazyCommand(
        "stats",
        "dataset.inspect:stats",
        "Show how labels are spread.",
        ("handsight dataset stats grasps", "handsight dataset stats grasps@v1 --plot stats.png"),
    ),
    # Decide which attempts count.
    LazyCommand(
        "exclude",
        "dataset.curation:exclude",
        "Keep attempts out of training.",
        (
            "handsight dataset exclude grasps 92 93 -m 'camera moved'",
            "handsight dataset exclude grasps --where 'contact_force_n > 40' -m collision --dry-run",
        ),
    ),
    LazyCommand(
        "restore",
        "dataset.curation:restore",
        "Take excluded attempts back in.",
        ("handsight dataset restore grasps 92 -m 'looked again'",),
    ),
    LazyCommand(
        "relabel",
        "dataset.curation:relabel",
        "Correct labels.",
        (
            "handsight dataset relabel grasps 92 --to failure -m 'the gripper closed on itself'",
            "handsight dataset relabel grasps 92 --to recorded -m 'it was right'",
        ),
    ),
    LazyCommand(
        "undo",
        "dataset.curation:undo",
        "Revert a curation decision.",
        ("handsight dataset undo grasps", "handsight dataset undo grasps 3 -m 'wrong filter'"),
    ),
    LazyCommand(
        "decisions",
        "dataset.curation:decisions",
        "List the decisions of curation, oldest first.",
        ("handsight dataset decisions grasps",),
    ),
    LazyCommand(
        "filter",
        "dataset.curation:filter_command",
        "Save, list or forget filters: named --where expressions.",
        (
            "handsight dataset filter grasps slips --where 'width_final_m < 0.004 and not success'",
            "handsight dataset filter grasps",
            "handsight dataset filter grasps slips --delete",
        ),
    ),
    LazyCommand(
        "folds",
        "dataset.folds:folds",
        "Make, check or list the folds that are stored in a version.",
        ("handsight dataset folds grasps cv5 --by object -k 5", "handsight dataset folds grasps"),
    ),
    LazyCommand(
        "suspect",
        "dataset.suspect:suspect",
        "List likely label issues, lowest label quality first.",
        ("handsight dataset suspect grasps -n 40 --rrd issues.rrd",),
    ),
    LazyCommand(
        "score",
        "dataset.score:score",
        "Write back what a network expects of attempts.",
        (
            "handsight dataset score grasps rgbd --model runs/rgbd",
            "handsight dataset score grasps honest --folds by-object",
            "handsight dataset score grasps",
        ),
        kept="no scores were stored",
    ),
    LazyCommand(
        "similar",
        "dataset.similar:similar",
        "List attempts that a network finds alike.",
        (
            "handsight dataset similar grasps 92 --model runs/rgbd",
            "handsight dataset similar grasps --groups --model runs/rgbd",
        ),
    ),
    LazyCommand(
        "repeat",
        "dataset.repeat:repeat",
        "Perform attempts again, a little beside.",
        (
            "handsight dataset repeat grasps",
            "handsight dataset repeat grasps --shift-mm 0.5 --turn-deg 0 --where \"target == 'mug'\"",
        ),
        kept="the dataset is as it was; the same call begins anew",
    ),
    # Check and repair.
    LazyCommand(
        "doctor",
        "dataset.integrity:doctor_command",
        "Check a version for what spoils training.",
        ("handsight dataset doctor grasps", "handsight dataset doctor grasps --deep --resimulate 20"),
        kept="the dataset is as it was; the same call begins anew",
    ),
    LazyCommand(
        "verify",
        "dataset.integrity:verify_command",
        "Compare every stored byte with what was recorded.",
        ("handsight dataset verify grasps -j 4", "handsight dataset verify grasps --all"),
        kept="the dataset is as it was; the same call begins anew",
    ),
    LazyCommand(
        "repair",
        "dataset.integrity:repair_command",
        "Replace damaged attempts on a new branch.",
        ("handsight dataset repair grasps --branch repaired --resimulate",),
        kept="the version itself is as it was; the same call begins anew",
    ),
    LazyCommand(
        "gc",
        "dataset.integrity:gc",
        "Delete files that no version needs.",
        ("handsight dataset gc grasps --dry-run", "handsight dataset gc grasps --older-than 2h"),
        kept="what was deleted by then belonged to no version; the same call deletes the rest",
    ),
    LazyCommand(
        "expire",
        "dataset.integrity:expire_command",
        "Drop old commits from the history.",
        ("handsight dataset expire grasps --older-than 7d --dry-run",),
    ),
    # In other forms and other places.
    LazyCommand(
        "export",
        "dataset.exchange:export_command",
        "Write a version in another format.",
        (
            "handsight dataset export grasps@v1 grasps.hdf5 -f hdf5",
            "handsight dataset export grasps@v1 plain.zarr -f zarr",
        ),
        kept="nothing was written",
    ),
    LazyCommand(
        "import",
        "dataset.exchange:import_command",
        "Add what another format holds to a dataset.",
        (
            "handsight dataset import grasps.hdf5 grasps --dry-run",
            "handsight dataset import pictures grasps -f images",
            "handsight dataset import ur5e_grasps grasps --map map.toml --dry-run",
        ),
        kept="nothing was added; the same call begins anew",
    ),
    LazyCommand(
        "merge",
        "dataset.exchange:merge_command",
        "Copy sessions of one dataset into another.",
        ("handsight dataset merge monday@v1 week", "handsight dataset merge monday week --dry-run"),
        kept="nothing was added; the same call begins anew",
    ),
    LazyCommand(
        "materialize",
        "dataset.exchange:materialize_command",
        "Make the network inputs of a version.",
        ("handsight dataset materialize grasps@v1 --size 64",),
        kept="no inputs were kept",
    ),
)


class DatasetGroup(LazyGroup):
    """Everything behind ``handsight dataset``."""

    table = COMMANDS


dataset_app = lazy_app(DatasetGroup, help="Create, inspect and release grasp datasets.")
