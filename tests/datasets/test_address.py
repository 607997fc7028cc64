from __future__ import annotations

from pathlib import Path

import pytest

from handsight.datasets import AddressError, DatasetAddress, DatasetError, GraspRepository
from handsight.datasets.address import S3Prefix, check_dataset_folder


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
