from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.support.typed_values import address_text

from handsight.datasets import (
    AddressError,
    DatasetAddress,
    DatasetError,
    DatasetNotFoundError,
    GraspRepository,
    NotADatasetError,
)
from handsight.datasets.address import S3Prefix, cache_folder, check_dataset_folder


@pytest.mark.parametrize(
    ("text", "path", "ref"),
    [
        ("grasps", "grasps", "main"),
        ("grasps@v1", "grasps", "v1"),
        ("/data/grasps@v1.0-rc1", "/data/grasps", "v1.0-rc1"),
        ("/home/me@work/grasps", "/home/me@work/grasps", "main"),
        ("/home/me@work/grasps@v1", "/home/me@work/grasps", "v1"),
        ("a@b@v1", "a@b", "v1"),
        ("grasps/", "grasps", "main"),
        ("./grasps@Y3PBDY0BM5SY52X9J2TG", "./grasps", "Y3PBDY0BM5SY52X9J2TG"),
    ],
)
def test_parse(text: str, path: str, ref: str) -> None:
    assert DatasetAddress.parse(text) == DatasetAddress(path=Path(path), ref=ref)


@pytest.mark.parametrize("text", ["", "/", "@v1", "grasps@", "a/@v1", "a/b@@", "https://x/y@v1", "gs://bucket/grasps"])
def test_text_that_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(AddressError, match="dataset address"):
        DatasetAddress.parse(text)


def test_str_can_be_parsed_again() -> None:
    for path in (Path("/a@b/grasps"), S3Prefix(bucket="lab-data", prefix="week/grasps")):
        address = DatasetAddress(path=path, ref="v1")
        assert DatasetAddress.parse(str(address)) == address


@pytest.mark.parametrize("text", ["s3://bucket/a/b@v1", str(Path("s3://bucket/a/b@v1"))])
def test_a_place_in_a_bucket(text: str) -> None:
    assert DatasetAddress.parse(text) == DatasetAddress(path=S3Prefix(bucket="bucket", prefix="a/b"), ref="v1")


@pytest.mark.parametrize("text", ["s3://bucket", "s3:///grasps", "s3://Bucket/a", "s3://bucket/a/../b", "s3://b@v1"])
def test_a_bucket_needs_a_sound_name_and_prefix(text: str) -> None:
    with pytest.raises(AddressError, match="expected a folder or s3://BUCKET/PREFIX"):
        DatasetAddress.parse(text)


def test_what_cannot_be_a_dataset_is_refused_as_opening_refuses_it(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for name in ("nothing", "file", "."):
        with pytest.raises(DatasetError) as cheap:
            check_dataset_folder(tmp_path / name)
        with pytest.raises(DatasetError) as opening:
            GraspRepository.open(tmp_path / name)
        assert type(cheap.value) is type(opening.value)
        assert str(cheap.value) == str(opening.value)
    check_dataset_folder(GraspRepository.create(tmp_path / "grasps").folder)
    check_dataset_folder(S3Prefix(bucket="lab", prefix="grasps"))  # nobody is asked


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("s3://b/g", "a bucket's name has 3 to 63 characters, and 'b' has 1"),
        (f"s3://{'b' * 64}/g", "has 3 to 63 characters"),
        ("s3://Bucket/g", "holds lower-case letters, digits, '-' and '.' alone, unlike 'Bucket'"),
        ("s3://my_lab/g", "holds lower-case letters, digits, '-' and '.' alone"),
        ("s3://-lab/g", "begins and ends with a letter or digit"),
        ("s3://a..b/g", "holds no two dots in a row"),
        ("s3:///g", "the bucket is missing"),
        ("s3:/", "the bucket is missing"),
        ("s3://bucket", "the prefix behind the bucket is missing"),
        ("s3://bucket/a/../b", "holds the part '..'"),
        ("s3:/B/", "lower-case letters"),
        ("S3://b/g", "has 3 to 63 characters"),
        ("gs://lab/grasps", "gs:// is not known"),
        ("https://lab/grasps", "https:// is not known"),
    ],
)
def test_the_rule_that_an_address_breaks_is_named(text: str, said: str) -> None:
    with pytest.raises(AddressError) as refused:
        DatasetAddress.parse(text)
    assert said in str(refused.value)


def test_the_home_folder_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert DatasetAddress.parse("~/grasps@v1") == DatasetAddress(path=tmp_path / "grasps", ref="v1")
    assert GraspRepository.create("~/grasps").folder == tmp_path / "grasps"
    assert DatasetAddress.parse("./~/grasps").path == Path("./~/grasps")
    with pytest.raises(AddressError, match="no such home folder: write the path in full"):
        DatasetAddress.parse("~nobody-of-that-name/grasps")


def test_without_a_home_folder_caches_need_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(self: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("HANDSIGHT_CACHE", raising=False)
    monkeypatch.setattr(Path, "expanduser", homeless)
    with pytest.raises(AddressError, match="set HANDSIGHT_CACHE"):
        cache_folder()


@pytest.mark.parametrize("name", ["lab@home", "grasps@v1", "@"])
def test_a_name_that_could_not_be_opened_is_not_made(tmp_path: Path, name: str) -> None:
    for make in (GraspRepository.create, GraspRepository.open_or_create):
        with pytest.raises(AddressError, match="what follows '@' names a version"):
            make(tmp_path / name)
    with pytest.raises(AddressError, match="what follows '@' names a version"):
        GraspRepository.create(S3Prefix(bucket="lab", prefix=f"week/{name}"))
    assert list(tmp_path.iterdir()) == []
    assert GraspRepository.create(tmp_path / "lab@home" / "grasps").path == tmp_path / "lab@home" / "grasps"


def test_a_link_that_leads_nowhere_is_called_one(tmp_path: Path) -> None:
    link = tmp_path / "grasps"
    link.symlink_to(tmp_path / "unplugged")
    with pytest.raises(DatasetNotFoundError, match=r"is a link to .*unplugged, which is not there"):
        check_dataset_folder(link)
    with pytest.raises(NotADatasetError, match=r"is a link to .*unplugged, which is not there"):
        GraspRepository.create(link)
    assert link.is_symlink()


def test_whatever_is_typed_is_an_address_or_refused() -> None:
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(200):
        try:
            DatasetAddress.parse(address_text(rng))
        except AddressError:
            refused += 1
    assert 0 < refused < 200
