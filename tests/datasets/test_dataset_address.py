from __future__ import annotations

from pathlib import Path

import pytest

from handsight.datasets import AddressError, DatasetAddress


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


@pytest.mark.parametrize("text", ["", "/", "@v1", "grasps@", "a/@v1", "a/b@@", "s3://bucket/grasps", "https://x/y@v1"])
def test_text_that_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(AddressError, match="dataset address"):
        DatasetAddress.parse(text)


def test_str_can_be_parsed_again() -> None:
    address = DatasetAddress(path=Path("/a@b/grasps"), ref="v1")
    assert DatasetAddress.parse(str(address)) == address
