"""Recordings on demand: each is made once, registered before anybody is answered, and the disk is bounded."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from handsight.viz.browser.shelf import ON_SCREEN, Kind, Shelf, Wanted, recording_id, wanted_in

SESSION = "01M8D7AEHT2D4A36HWXR6AQSTY"
SIZE = 1000


def name(number: int) -> str:
    return f"{SESSION}-{number:06d}"


@dataclass
class Catalog:
    """What the shelf tells of."""

    known: set[str] = field(default_factory=set)
    made: list[Wanted] = field(default_factory=list)
    broken: frozenset[str] = frozenset()

    def make(self, wanted: Wanted, path: Path) -> None:
        if wanted.attempt in self.broken:
            raise OSError("the disk is full")
        self.made.append(wanted)
        path.write_bytes(b"x" * SIZE)

    def register(self, kind: Kind, paths: list[Path]) -> None:
        assert all(path.stat().st_size == SIZE for path in paths)
        self.known |= {f"{kind}/{path.stem}" for path in paths}

    def forget(self, kind: Kind, recordings: list[str]) -> None:
        assert all(one.startswith(f"{kind}-{SESSION}") for one in recordings)
        self.known -= {f"{kind}/{one.removeprefix(f'{kind}-')}" for one in recordings}


def shelf(tmp_path: Path, catalog: Catalog, *, count: int = 400, limit: int = 10**9) -> Shelf:
    return Shelf(
        cards=tmp_path / "cards",
        attempts=tmp_path / "attempts",
        label_of={name(number): "success" for number in range(count)},
        make=catalog.make,
        register=catalog.register,
        forget=catalog.forget,
        limit_bytes=limit,
    )


def test_names_are_found_among_other_bytes() -> None:
    piece = (
        b"\x00\x12$" + recording_id("card", name(3)).encode() + b"\x1a\xffattempt-" + name(1_234_567).encode() + b"\n"
    )
    assert wanted_in(piece) == {Wanted("card", name(3)), Wanted("attempt", name(1_234_567))}
    assert wanted_in(b"card-" + SESSION.encode() + b"-12") == set()
    assert wanted_in(b"rd-" + name(3).encode()) == set()


def test_what_is_asked_for_is_made_once_and_known(tmp_path: Path) -> None:
    catalog = Catalog()
    kept = shelf(tmp_path, catalog)
    for _ in range(2):
        kept.ready(f"..attempt-{name(5)}..card-{name(6)}..card-{SESSION}-999999".encode())
    assert catalog.made == [Wanted("attempt", name(5)), Wanted("card", name(6))]
    assert catalog.known == {f"attempt/{name(5)}", "card/000006-success"}
    assert (kept.made, kept.bytes_kept) == (2, 2 * SIZE)


def test_cards_are_kept_for_the_next_time_and_recordings_of_attempts_are_not(tmp_path: Path) -> None:
    shelf(tmp_path / "first", Catalog()).provide([Wanted("card", name(1)), Wanted("attempt", name(1))])
    catalog = Catalog()
    again = Shelf(
        cards=tmp_path / "first" / "cards",
        attempts=tmp_path / "second",
        label_of={name(1): "success"},
        make=catalog.make,
        register=catalog.register,
        forget=catalog.forget,
        limit_bytes=10**9,
    )
    again.provide([Wanted("card", name(1)), Wanted("attempt", name(1))])
    assert catalog.made == [Wanted("attempt", name(1))]
    assert len(catalog.known) == 2


def test_a_decision_makes_recordings_anew(tmp_path: Path) -> None:
    catalog = Catalog()
    kept = shelf(tmp_path, catalog)
    both = [Wanted("card", name(1)), Wanted("attempt", name(1))]
    kept.provide(both)
    kept.decided({name(1): "failure"})
    kept.provide(both)
    assert catalog.made == [*both, *both]
    assert "card/000001-failure" in catalog.known
    assert sorted(path.name for path in (tmp_path / "cards" / SESSION).iterdir()) == [
        "000001-failure.rrd",
        "000001-success.rrd",
    ]


def test_the_disk_is_bounded_and_what_is_looked_at_stays(tmp_path: Path) -> None:
    catalog = Catalog()
    kept = shelf(tmp_path, catalog, limit=200 * SIZE)
    for number in range(300):
        kept.provide([Wanted("attempt", name(number))])
        assert kept.bytes_kept <= 200 * SIZE
    files = {path.stem for path in (tmp_path / "attempts").iterdir()}
    assert {f"attempt/{stem}" for stem in files} == catalog.known
    assert {name(number) for number in range(300 - ON_SCREEN, 300)} <= files
    kept.provide([Wanted("attempt", name(0))])
    assert catalog.made.count(Wanted("attempt", name(0))) == 2


def test_the_bound_holds_for_cards_of_other_datasets_too(tmp_path: Path) -> None:
    old = tmp_path / "cards" / "01M8D7AEHT2D4A36HWXR6AQSTZ"
    old.mkdir(parents=True)
    for number in range(10):
        (old / f"{number:06d}-success.rrd").write_bytes(b"x" * SIZE)
    kept = shelf(tmp_path, Catalog(), limit=5 * SIZE)
    kept.provide([Wanted("card", name(0))])
    assert len(list(old.iterdir())) == 4


@pytest.mark.parametrize("kind", ["card", "attempt"])
def test_one_that_cannot_be_made_is_remembered_and_the_others_are_there(tmp_path: Path, kind: Kind) -> None:
    catalog = Catalog(broken=frozenset({name(1)}))
    kept = shelf(tmp_path, catalog)
    for _ in range(2):
        kept.provide([Wanted(kind, name(number)) for number in range(3)])
    assert [one.attempt for one in catalog.made] == [name(0), name(2)]
    assert {one.attempt: str(error) for one, error in kept.failed.items()} == {name(1): "the disk is full"}
