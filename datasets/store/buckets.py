"""Where buckets are: as other tools find them, by the environment."""

from __future__ import annotations

import os


def bucket_endpoint() -> str | None:
    """The server to ask instead of Amazon's own, if any."""
    return os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or None


def bucket_region() -> str:
    """The region of the server's buckets."""
    return os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or "us-east-1"
